"""Results of short runs, for tests of what is made of results."""

from __future__ import annotations

from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import Writer

from rose2_logs.workflows.analyze import RunOptions, analyze_log

SAMPLE_LOGS = Path(__file__).parents[2] / "sample_logs"


def run_of(log: Path, folder: Path, snapshots: int = 6, **options) -> Path:
    """Analyze some maps of a log; return the folder of its results."""
    return analyze_log(log, folder, RunOptions(max_snapshots=snapshots, recording=False, **options)).folder


def renamed_topic(log: Path, topic: str, to: Path) -> Path:
    """Copy the maps of an MCAP to another topic."""
    with log.open("rb") as source, to.open("wb") as target:
        writer = Writer(target)
        writer.start("ros2")
        channel = None
        for schema, copied, message in make_reader(source).iter_messages("/map"):
            if channel is None:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channel = writer.register_channel(topic, copied.message_encoding, number, copied.metadata)
            writer.add_message(channel, message.log_time, message.data, message.publish_time)
        writer.finish()
    return to
