"""Command: what was tracked as a film or a picture that leaves the program."""

from __future__ import annotations

from pathlib import Path

import click

from capture.console import stdout, tell
from capture.progress import progress

_PATH = click.Path(path_type=Path)


@click.command("movie")
@click.argument("source", type=_PATH)
@click.option("--subject", type=_PATH, help="Who moves [default: whom the motion knows].")
@click.option(
    "--recording", type=_PATH, help="The recording: adds points; an overlay needs it [default: as for --subject]."
)
@click.option("--overlay", is_flag=True, help="Skin and bones over a sensor's colour or depth, not the scene in space.")
@click.option("--sensor", help="Whose images the overlay shows [default: the first sensor's].")
@click.option("--frame", type=click.IntRange(0), help="Write a picture of this frame alone; --out then ends in .png.")
@click.option("--width", type=click.IntRange(160, 3840), default=960, show_default=True, help="Of the picture (px).")
@click.option("--out", required=True, type=_PATH, help="The .mp4 or .png file to write.")
def movie_command(
    source: Path,
    subject: Path | None,
    recording: Path | None,
    overlay: bool,
    sensor: str | None,
    frame: int | None,
    width: int,
    out: Path,
) -> None:
    """Write a film (.mp4) of SOURCE, a motion or a recording, or a picture (.png) of one frame of it."""
    from capture.own import PNG, refuse_foreign
    from track.view.film import MP4, FilmError, refuse_without_av, write_film
    from track.view.film_frames import OverlayFilm, SceneFilm
    from track.view.render import save_png
    from track.view.scene import open_scene
    from track.whereabouts import is_motion, made_from

    ending = ".mp4" if frame is None else ".png"
    if out.suffix.lower() != ending:
        raise click.BadParameter(f"a {'film' if frame is None else 'picture'} ends in {ending}", param_hint="--out")
    if frame is None:
        refuse_without_av()
    refuse_foreign(out, MP4 if frame is None else PNG)
    if is_motion(source):
        subject, recording = made_from(source, subject=subject, recording=recording, told=tell)
    scene = open_scene(source, subject=subject, recording=recording)
    if frame is not None and frame >= len(scene.times):
        raise FilmError(f"no frame {frame}", where=source, remedy=f"frames run from 0 to {len(scene.times) - 1}")
    film = OverlayFilm(scene, sensor, width=width) if overlay else SceneFilm(scene, width=width, height=3 * width // 4)
    with progress("drawing"):
        if frame is not None:
            save_png(film.picture(frame), out)
        else:
            write_film((film.picture(k) for k in range(len(scene.times))), scene.times, out)
    stdout.print(f"{'film' if frame is None else 'picture'} written to {out}", highlight=False)
