"""Commands: look at a recording, a subject or a motion in the browser, and write a motion's report."""

from __future__ import annotations

from pathlib import Path

import click

from capture.commands.region_options import as_region, near_option, region_near, region_option
from capture.commands.written_file import WrittenFile
from capture.console import stdout, tell
from capture.progress import progress

_PATH = click.Path(path_type=Path)


@click.command("view")
@click.argument("source", type=_PATH)
@click.option("--subject", type=_PATH, help="Who moves [default: whom the motion knows].")
@click.option(
    "--recording",
    type=_PATH,
    help="The recording of a motion or a subject: adds points, and known truth [default: the one the motion knows].",
)
@click.option("--markers", type=_PATH, help="A laboratory's markers, as `bonetrack import-markers` wrote them.")
@click.option(
    "--html", type=WrittenFile(".html", "HTML"), help="Write the scene as one HTML file that needs no network, and end."
)
@click.option(
    "--poses",
    type=_PATH,
    default=Path("poses.json"),
    show_default=True,
    help="Where poses set by hand are kept (docs/view.md).",
)
@click.option("--host", default="127.0.0.1", show_default=True, help="0.0.0.0 lets other machines look, too.")
@click.option("--port", type=click.IntRange(1, 65535), default=8080, show_default=True, help="The first to try.")
@region_option
@near_option
def view_command(
    source: Path,
    subject: Path | None,
    recording: Path | None,
    markers: Path | None,
    html: Path | None,
    poses: Path,
    host: str,
    port: int,
    region: tuple[float, ...] | None,
    near: tuple[float, ...] | None,
) -> None:
    """Look at SOURCE, a recording, a subject or a motion, in the browser: skin, bones, points, angles over time."""
    from track.belonging import adapted_elsewhere
    from track.view.scene import open_scene, with_markers
    from track.whereabouts import is_motion, made_from

    if is_motion(source):
        subject, recording = made_from(source, subject=subject, recording=recording, told=tell)
    scene = open_scene(source, subject=subject, recording=recording)
    scene = scene if markers is None else with_markers(scene, markers)
    person, seen = scene.subject, scene.recording
    if seen is None and near is not None:
        raise click.BadParameter("needs a recording, in which somebody is near it", param_hint="--near")
    chosen = as_region(region) if seen is None else region_near(seen, region, near)
    if person is not None and seen is not None and (elsewhere := adapted_elsewhere(person, seen)):
        stdout.print(elsewhere, highlight=False)
    if html is not None:
        from track.view.embedded import write_embedded

        with progress("collecting frames"):
            frames = write_embedded(scene, html, region=chosen)
        size = html.stat().st_size / 1e6
        stdout.print(f"{frames} of {len(scene.times)} frames written to {html} ({size:.1f} MB)", highlight=False)
        return
    from track.view.viewer import Viewer, start_server, stop_server

    server = start_server(host=host, port=port)
    try:
        viewer = Viewer(server, scene, poses=poses, region=chosen)
    except BaseException:
        stop_server(server)
        raise
    stdout.print(f"open http://{server.get_host()}:{server.get_port()} in a browser; Ctrl+C ends", highlight=False)
    try:
        server.sleep_forever()
    except KeyboardInterrupt:
        stdout.print("ended")
    finally:
        viewer.stop()


@click.command("report")
@click.argument("motion", type=_PATH)
@click.option("--subject", type=_PATH, help="The subject that was tracked [default: the one the motion knows].")
@click.option(
    "--recording",
    type=_PATH,
    help="The recording that was tracked: adds what is known of it, and truth [default: the one the motion knows].",
)
@click.option("--out", required=True, type=WrittenFile(".html", "HTML"), help="The HTML file to write.")
@click.option("--title", help="What the page is called.")
@click.option("--person", help="Whose motion it is, by a name or a number of yours.")
@click.option("--session", help="When or which: `before`, `week 6`.")
@click.option("--note", help="What else is to be said, on the first page.")
def report_command(
    motion: Path,
    subject: Path | None,
    recording: Path | None,
    out: Path,
    title: str | None,
    person: str | None,
    session: str | None,
    note: str | None,
) -> None:
    """Write what tracking says of MOTION as one HTML page that needs no network.

    Title, person, session and note stay with the motion (about.json in its folder): later reports, curves and
    comparisons have them, too.
    """
    from adapt.subject import load_subject
    from capture.recording import open_recording
    from track.about import note_about
    from track.motion import load_motion
    from track.view.report import write_report
    from track.whereabouts import made_from

    subject, recording = made_from(motion, subject=subject, recording=recording, told=tell)
    opened = None if recording is None else open_recording(recording)
    loaded = load_motion(motion)
    about = note_about(motion, title=title, person=person, session=session, note=note)
    with progress("writing the report"):
        write_report(loaded, load_subject(subject), opened, out, title=motion.resolve().name, about=about)
    stdout.print(f"report written to {out} ({out.stat().st_size / 1e6:.1f} MB)", highlight=False)
