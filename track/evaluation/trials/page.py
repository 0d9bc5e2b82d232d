"""The page of the field trials: what was tried, what came out once, what happens now."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from track.evaluation.experiments.experiment import markdown_table
from track.evaluation.trials.fit import BOUND_DEG, GROSS_DEG, HONEST
from track.evaluation.trials.situation import SOUND_SEED, Outcome, Situation

_HEAD = f"""# Field trials: right, or refused

Made by

```sh
python -m track.evaluation.field_trials --out DIR --sound 50 --real RECORDINGS --page docs/field-trials.md
```

Every situation here is synthetic unless it stands under "Real recordings": a random body of our own model, 20 instants,
simulated depth sensors, and then what people bring. It goes through `bonetrack calibrate`, `adapt` and `track` with no
option but `--anatomy`, or through the command that the row names. Bounds of the program are set on other variants
(`--split tuning`) than the ones shown.

*Right*: the mean error of every joint angle is at most {BOUND_DEG:g} degrees, at least {100 * HONEST:.0f} % of all
errors are within two stated deviations, and no frame is off by more than {GROSS_DEG:g} degrees and two deviations: one
such frame without a word makes the case a silent error. *Overconfident*: only the share is missed. *Said*: a result
beside a plain word that it is doubtful, or deviations that are as wide as its errors. *Refused* and *asked*: one line,
and no result. *Shown*: a result of a real recording, which has no truth, for the eye to judge. *Failed*: no end, or an
error that tells nothing.
"""

_SECTIONS = {
    1: "Whom and what the sensors see",
    2: "Time, and which sensor said what",
    3: "Import",
    4: "Files for other programs",
    5: "What is the user's own",
    6: "Real recordings",
}


def page_text(
    situations: Sequence[Situation],
    found: Mapping[str, Mapping[int, Outcome]],
    *,
    split: str,
    sound: Sequence[tuple[str, int, Outcome]] = (),
    skipped: str = "",
) -> str:
    """The whole page from the outcomes by situation and seed, and name, seed and outcome of further ``sound`` cases."""
    sections = [_section(number, situations, found) for number in _SECTIONS]
    notes = [f"*Variants: {split}.*\n", *([f"*Real recordings were not run: {skipped}.*\n"] if skipped else [])]
    return "\n".join([_HEAD, *notes, _losses(situations, found), _sound(sound), *(text for text in sections if text)])


def _sound(cases: Sequence[tuple[str, int, Outcome]]) -> str:
    """How many further sound recordings came out right, and what became of the others."""
    if not cases:
        return "## Sound recordings\n\nNo further ones were run.\n"
    counts = Counter(outcome.verdict for _, _, outcome in cases)
    total = ", ".join(f"{count} {verdict}" for verdict, count in counts.most_common())
    others = [f"- {name}, seed {seed}: {o.verdict}: {o.line}" for name, seed, o in cases if o.verdict != "right"]
    told = f"{len(cases)} further ones (seeds from {SOUND_SEED} on, used for no bound): {total}."
    lines = [told, "", _shares(cases), "", *others]
    return "## Sound recordings\n\n" + "\n".join(lines).rstrip() + "\n"


def _shares(cases: Sequence[tuple[str, int, Outcome]]) -> str:
    """How many of the angles' errors are within two stated deviations, by situation, over all its recordings."""
    found: dict[str, list[float]] = {}
    for name, _, outcome in cases:
        if outcome.numbers.get("within_2_sd") is not None:
            found.setdefault(name, []).append(float(outcome.numbers["within_2_sd"]))
    shares = ", ".join(f"{name} {100 * sum(values) / len(values):.0f} %" for name, values in found.items())
    return f"Errors of angles within two stated deviations: {shares or 'not known'}."


def _section(number: int, situations: Sequence[Situation], found: Mapping[str, Mapping[int, Outcome]]) -> str:
    chosen = [situation for situation in situations if situation.section == number]
    if not chosen:
        return ""
    rows = [["what was tried", "what came out at b072a01", "what happens now"]]
    rows += [[s.tried, s.before or "not tried", _now(found.get(s.name, {}))] for s in chosen]
    return f"## {_SECTIONS[number]}\n\n{markdown_table([[_cell(c) for c in row] for row in rows])}\n"


def _now(outcomes: Mapping[int, Outcome]) -> str:
    if not outcomes:
        return "not run"
    return "<br>".join(f"**{outcome.verdict}**: {outcome.line}" for outcome in outcomes.values())


def _cell(text: str) -> str:
    """Text that stays within one cell of a table."""
    return " ".join(text.replace("|", "\\|").replace("<", "&lt;").replace("&lt;br>", "<br>").split())


def _losses(situations: Sequence[Situation], found: Mapping[str, Mapping[int, Outcome]]) -> str:
    """How many cases came out how, and those that may not come out so."""
    cases = [(s, seed, outcome) for s in situations for seed, outcome in found.get(s.name, {}).items()]
    counts = Counter(outcome.verdict for _, _, outcome in cases)
    total = ", ".join(f"{count} {verdict}" for verdict, count in counts.most_common())
    bad = [f"- {s.name}, variant {seed}: {o.verdict}" for s, seed, o in cases if not s.good(o)]
    text = "\n".join(bad) or "Nowhere in these cases."
    silent = counts["WRONG WITHOUT A WORD"]
    return f"""{len(cases)} cases: {total or "none"}. Silent wrong results: {silent or "none"}.

## Where we lose

{text}
"""
