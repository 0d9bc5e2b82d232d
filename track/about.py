"""What people note of a motion: who, which session, a title, a note. It stays with the motion, in ``about.json``."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

from capture.own import json_of, replaced_if_own
from track.motion import MotionError

FORMAT = "bonetrack-about"
FILE = "about.json"


@dataclass(frozen=True)
class About:
    """Words for people; empty where nothing was said."""

    title: str = ""
    person: str = ""
    session: str = ""
    note: str = ""


def read_about(motion: Path) -> About:
    """What was noted of a motion, a folder or the ``motion.npz`` in one; nothing where nothing was.

    Raises:
        MotionError: the file is there and is none of these.

    >>> read_about(Path("no such motion"))
    About(title='', person='', session='', note='')
    """
    path = _file(motion)
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        if kept["format"] != FORMAT:
            raise ValueError(kept["format"])
        return About(**{field.name: str(kept.get(field.name, "")) for field in fields(About)})
    except FileNotFoundError:
        return About()
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise MotionError("is no file of notes", where=path, remedy="mend or delete it") from error


def note_about(motion: Path, **said: str | None) -> About:
    """Keep what is said of a motion beside what was said before; None says nothing.

    Raises:
        MotionError: see ``read_about``.
        OutputError: something else stands in the file's place.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     _ = note_about(Path(folder), person="P07", note=None)
    ...     note_about(Path(folder), session="after")
    About(title='', person='P07', session='after', note='')
    """
    about = replace(read_about(motion), **{name: words for name, words in said.items() if words is not None})
    if any(words is not None for words in said.values()):
        with replaced_if_own(_file(motion), json_of(FORMAT)) as partial:
            partial.write_text(json.dumps({"format": FORMAT} | asdict(about), indent=1) + "\n", encoding="utf-8")
    return about


def _file(motion: Path) -> Path:
    return (motion.parent if motion.is_file() else motion) / FILE
