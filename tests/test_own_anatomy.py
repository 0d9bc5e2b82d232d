"""A user's own anatomy file: what is wrong with it is told, and what is made with it holds it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from adapt import own_anatomy
from adapt.anatomy import Anatomy, Coordinate
from adapt.anatomy_check import refuse_unsound
from adapt.anatomy_file import anatomy_names, former_anatomies, load_anatomy, save_anatomy
from adapt.mirror import mirrored
from adapt.model.body import make_body, rest_theta
from adapt.own_anatomy import DIGEST, KEY, content, is_comparable, is_shipped, kept_anatomy, other_side_asked
from adapt.search.rival_side import SideEvidence, refuse_the_other_side
from adapt.subject import Subject, load_subject, save_subject
from capture.errors import AnatomyError, FitError
from capture.files import read_arrays
from track.accuracy.truth import read_truth
from track.batch.items import BatchError, read_items
from track.batch.work import run_item
from track.simulation.performance import Performance
from track.simulation.simulate import simulate_performance


@pytest.fixture
def file(arm: Anatomy, tmp_path: Path) -> Path:
    """An arm that counts its skin otherwise than the one that ships."""
    path = tmp_path / "my.arm.npz"
    save_anatomy(replace(arm, fit_weight=0.9 * arm.fit_weight), path)
    return path


def subject_of(anatomy: Anatomy) -> Subject:
    body = make_body(anatomy)
    return Subject(body, rest_theta(body)[None], np.zeros(1), np.eye(len(body.shape)), {})


def saved(anatomy: Anatomy, path: Path) -> Path:
    save_subject(subject_of(anatomy), path)
    return path


# ---- names and sides


def test_what_ships_is_named_and_anything_else_is_kept_whole(arm: Anatomy, file: Path) -> None:
    for name in anatomy_names():
        assert is_shipped(load_anatomy(name))
        assert set(kept_anatomy(load_anatomy(name))) == {DIGEST}
    own = load_anatomy(file)
    assert own.name == "my.arm"
    assert not is_shipped(own)
    assert not is_shipped(replace(own, name=arm.name))  # a changed one that is called as one that ships
    assert set(kept_anatomy(own)) == {KEY}


def test_the_other_side_of_a_file_is_asked_for_by_its_mirrored_name(file: Path) -> None:
    own, other = load_anatomy(file), load_anatomy(file.with_name("my.arm-mirrored.npz"))
    assert (own.side, other.side, other.name) == ("right", "left", "my.arm-mirrored")
    assert content(other) == content(mirrored(own))
    file.rename(file.with_name("arm-right.npz"))
    assert load_anatomy(file.with_name("arm-left.npz")).side == "left"


def test_advice_names_the_other_side_so_that_it_is_found(arm: Anatomy, file: Path) -> None:
    assert other_side_asked(arm) == "`--anatomy upper-limb-left`"
    clearly = SideEvidence(asked_m=0.002, other_m=0.001, patches=100, prior=0.0)
    with pytest.raises(FitError, match=r"nearer to my\.arm-mirrored .* ask for `--anatomy my\.arm-mirrored\.npz`"):
        refuse_the_other_side(clearly, load_anatomy(file), where=file)
    assert load_anatomy(file.with_name("my.arm-mirrored.npz")).side == "left"


# ---- a subject of one's own anatomy


def test_a_subject_needs_no_anatomy_file_once_it_is_there(file: Path, tmp_path: Path) -> None:
    own = load_anatomy(file)
    path = saved(own, tmp_path / "subject.npz")
    file.unlink()
    again = load_subject(path).anatomy
    assert again.name == "my.arm"
    assert content(again) == content(own)


def test_a_subject_of_a_mirrored_file_comes_back_mirrored(file: Path, tmp_path: Path) -> None:
    other = load_anatomy(file.with_name("my.arm-mirrored.npz"))
    again = load_subject(saved(other, tmp_path / "subject.npz")).anatomy
    assert (again.side, again.name) == ("left", "my.arm-mirrored")
    assert content(again) == content(other)


def test_a_subject_of_an_anatomy_that_ships_names_it_with_a_digest(arm: Anatomy, tmp_path: Path) -> None:
    path = saved(arm, tmp_path / "subject.npz")
    known = dict.fromkeys(("description", KEY, DIGEST), 1 << 20)
    assert list(read_arrays(path, known)) == ["description", DIGEST]
    assert content(load_subject(path, anatomy=arm.name).anatomy) == content(arm)


def written_before(path: Path, anatomy: str, *, version: int = 2, **digest: np.ndarray) -> Path:
    """A subject's file as a former version wrote it, at first without a digest: changed in place."""
    with np.load(path) as arrays:
        kept = {name: array for name, array in arrays.items() if name not in (KEY, DIGEST)}
    told = json.loads(str(kept["description"])) | {"version": version, "anatomy": anatomy}
    np.savez_compressed(path, **(kept | {"description": np.array(json.dumps(told))} | digest))
    return path


@pytest.mark.parametrize("name", ["lower-limb-right", "upper-limb-left"])
def test_a_subject_of_before_the_templates_were_built_anew_has_the_bones_it_had(name: str, tmp_path: Path) -> None:
    former = next(former_anatomies(name))
    path = written_before(saved(former, tmp_path / "subject.npz"), name)
    again = load_subject(path, anatomy=name).anatomy
    assert content(again) == content(former) != content(load_anatomy(name))
    # Written by this version, it holds that anatomy itself.
    assert content(load_subject(saved(again, tmp_path / "copy.npz")).anatomy) == content(former)


def test_a_subject_of_the_arm_that_shipped_until_it_kept_clear_of_a_bent_wrists_skin_has_that_arm(
    tmp_path: Path,
) -> None:
    name = "upper-limb-left"
    _, former = former_anatomies(name)
    digest = {DIGEST: np.array(content(former))}
    path = written_before(saved(former, tmp_path / "subject.npz"), name, version=4, **digest)
    again = load_subject(path, anatomy=name).anatomy
    assert content(again) == content(former) != content(load_anatomy(name))


def test_a_subject_of_a_template_that_is_not_at_hand_is_refused_in_one_line(arm: Anatomy, tmp_path: Path) -> None:
    path = saved(arm, tmp_path / "subject.npz")
    with np.load(path) as arrays:
        kept = dict(arrays)
    np.savez_compressed(path, **(kept | {DIGEST: np.array("0" * 64)}))
    told = r"subject\.npz: made with another template of upper-limb-right; use the version of bonetrack"
    with pytest.raises(AnatomyError, match=told):
        load_subject(path)


def test_an_anatomy_asked_for_by_its_file_is_compared_by_what_it_holds(
    arm: Anatomy, file: Path, tmp_path: Path
) -> None:
    path = saved(load_anatomy(file), tmp_path / "subject.npz")
    moved = file.rename(tmp_path / "elsewhere.npz")
    assert load_subject(path, anatomy=str(moved)).anatomy.name == "my.arm"
    save_anatomy(arm, moved)
    told = r"subject\.npz: was adapted from my\.arm\.npz with another content than .*elsewhere\.npz has now; adapt"
    with pytest.raises(AnatomyError, match=told):
        load_subject(path, anatomy=str(moved))
    moved.unlink()
    with pytest.raises(AnatomyError, match=r"elsewhere\.npz: no such anatomy file; name a file that is there"):
        load_subject(path, anatomy=str(moved))
    with pytest.raises(AnatomyError, match=r"a subject of anatomy 'my\.arm\.npz', not 'upper-limb-right'"):
        load_subject(path, anatomy=arm.name)


def test_an_anatomy_too_large_for_a_subject_is_told(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_anatomy, "MOST_BYTES", 100_000)
    with pytest.raises(AnatomyError, match=r"takes 1\.\d MB, and a subject's file has room for one of 0\.1"):
        kept_anatomy(load_anatomy(file))


def test_a_damaged_anatomy_inside_a_subject_is_told_with_the_subject(arm: Anatomy, tmp_path: Path) -> None:
    path = saved(replace(arm, fit_weight=2.0 * arm.fit_weight), tmp_path / "subject.npz")
    with pytest.raises(AnatomyError, match=r"subject\.npz: not a sound anatomy: fit_weight is not in 0 to 1"):
        load_subject(path)


# ---- the truth of a simulated recording, and batches


def test_the_truth_of_a_simulated_recording_holds_the_anatomy(file: Path, tmp_path: Path) -> None:
    body = make_body(load_anatomy(file))
    file.unlink()
    performance = Performance(body, np.arange(2) / 30.0, np.tile(rest_theta(body), (2, 1)))
    recording = simulate_performance(performance, tmp_path / "recording")
    assert content(read_truth(recording).body.anatomy) == content(body.anatomy)


def test_anatomies_of_one_name_are_compared_only_where_they_go_point_by_point(arm: Anatomy) -> None:
    assert is_comparable(arm, replace(arm, fit_weight=0.9 * arm.fit_weight))
    assert not is_comparable(arm, replace(arm, name="other"))
    assert not is_comparable(arm, replace(arm, skin_faces=arm.skin_faces[1:]))
    assert not is_comparable(arm, replace(arm, bones=(*arm.bones[:-1], replace(arm.bones[-1], name="paw"))))
    assert not is_comparable(arm, _renamed(arm, arm.joints[-1].coordinates[-1]))


def _renamed(anatomy: Anatomy, coordinate: str) -> Anatomy:
    def new(name: str) -> str:
        return "other" if name == coordinate else name

    coordinates = tuple(replace(each, name=new(each.name)) for each in anatomy.coordinates)
    joints = tuple(replace(each, coordinates=tuple(map(new, each.coordinates))) for each in anatomy.joints)
    return replace(anatomy, coordinates=coordinates, joints=joints)


def test_a_batch_takes_anatomy_files_and_knows_when_they_changed(file: Path, arm: Anatomy, tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    table.write_text("recording,anatomy\nr,my.arm.npz\nr2,my.arm-mirrored.npz\nr3,upper-limb-right\n")
    items = read_items(table)
    names = [str(file), str(file.with_name("my.arm-mirrored.npz")), "upper-limb-right"]
    assert [item.anatomy for item in items] == names
    assert "content of the anatomy's file" in items[0].described()
    assert "content of the anatomy's file" not in items[2].described()
    run_item(items[0], tmp_path / "out", _fails)
    save_anatomy(arm, file)
    assert (
        "results of another content of the anatomy's file; give another --out"
        in run_item(read_items(table)[0], tmp_path / "out", _fails).error
    )
    file.unlink()
    with pytest.raises(BatchError, match=r"table\.csv, line 2: no such anatomy file: .*my\.arm\.npz; name"):
        read_items(table)


def _fails(*_: Any) -> Any:
    raise AnatomyError("not done")


# ---- what is wrong with a file is told before any work


@pytest.mark.parametrize("name", anatomy_names())
def test_what_ships_is_sound(name: str) -> None:
    refuse_unsound(load_anatomy(name), where=Path(name))


def _other(arm: Anatomy, **of_coordinate: Any) -> Anatomy:
    last = replace(arm.coordinates[-1], **of_coordinate)
    return replace(arm, coordinates=(*arm.coordinates[:-1], last))


WRONG: dict[str, Callable[[Anatomy], Anatomy]] = {
    "2 bones are called 'humerus'": lambda a: replace(a, bones=(a.bones[0], *a.bones)),
    "its side is 'up'": lambda a: replace(a, side="up"),
    "no bone 'tail'; use one of humerus": lambda a: replace(
        a, handles=(replace(a.handles[0], bone="tail"), *a.handles[1:])
    ),
    "the bone humerus has no handle": lambda a: replace(
        a, handles=tuple(replace(h, bone="ulna" if h.bone == "humerus" else h.bone) for h in a.handles)
    ),
    "is at rest outside its range": lambda a: _other(a, rest=9.0),
    "has no range": lambda a: _other(a, low=np.nan),
    "not of the kind it should be": lambda a: _other(a, low="0"),
    "no joint has the coordinate spare": lambda a: replace(
        a, coordinates=(*a.coordinates, Coordinate("spare", "rad", -1.0, 1.0, 0.0))
    ),
    "the first joint, and only that": lambda a: replace(a, joints=a.joints[::-1]),
    "no joint has the bone hand": lambda a: replace(a, joints=a.joints[:-1]),
    r"landmarks is of shape \(\d+, 3\), not": lambda a: replace(a, landmarks=a.landmarks[1:]),
    "landmarks reach farther than 20 m: are they in metres": lambda a: replace(a, landmarks=1e3 * a.landmarks),
    "has no position": lambda a: replace(
        a, handles=(replace(a.handles[0], position=(0.0, np.nan, 0.0)), *a.handles[1:])
    ),
    "fit_weight has values that are not finite": lambda a: replace(a, fit_weight=np.nan * a.fit_weight),
    "skin_faces are not whole numbers from 0": lambda a: replace(a, skin_faces=a.skin_faces + 1),
    "no tetrahedra called limb": lambda a: replace(a, tetrahedra={}),
    "rows of deformer_weights": lambda a: replace(a, deformer_weights=0.5 * a.deformer_weights),
    "weight on handles of other bones": lambda a: replace(
        a, bones=(replace(a.bones[0], handle_weights=a.bones[0].handle_weights[:, ::-1]), *a.bones[1:])
    ),
    "faces face inward": lambda a: replace(a, skin_faces=a.skin_faces[:, ::-1]),
    "the skin is not closed": lambda a: replace(a, skin_faces=a.skin_faces[1:]),
    "a bone or a joint is nowhere": lambda a: replace(a, joints=(*a.joints[:-1], replace(a.joints[-1], centre=()))),
    "a bone or a joint is nowhere: do its frames": lambda a: replace(a, landmarks=np.zeros_like(a.landmarks)),
    "posed as at rest, its skin is nan mm off": lambda a: replace(
        a, deformers=tuple(replace(d, frames=tuple(replace(f, y_to=f.y_from) for f in d.frames)) for d in a.deformers)
    ),
}


@pytest.mark.parametrize("told", WRONG)
def test_a_file_of_parts_that_do_not_go_together_is_told(told: str, arm: Anatomy, tmp_path: Path) -> None:
    save_anatomy(WRONG[told](arm), tmp_path / "wrong.npz")
    with pytest.raises(AnatomyError, match=rf"wrong\.npz: not a sound anatomy: .*{told}.*; mend the anatomy's data"):
        load_anatomy(tmp_path / "wrong.npz")
