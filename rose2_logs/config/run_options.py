"""Every option of a run, defined once: the command line, batches and the Python functions take theirs here.

An option is a field that `option` declares, with its default and an `Option` about it. To add one, add a
field here and use it where it matters.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from rose2_logs.config.baselines import METHODS
from rose2_logs.config.fields import changed_text
from rose2_logs.config.parameters import Parameters
from rose2_logs.config.reading import TYPES_WITHOUT_SCHEMA, ReadingParameters
from rose2_logs.config.regions import DETAIL_MOST
from rose2_logs.config.times import LONGEST_LOG_S
from rose2_logs.errors import ParameterError
from rose2_logs.system.files import expanded

if TYPE_CHECKING:
    from rose2_logs.config.selection import Selection

RECORDING_LAYERS = (
    "predicted",
    "borders",
    "path",
    "clean_map",
    "score",
    "spectrum",
    "segments",
    "lines",
    "faces",
    "voronoi",
)
"""Layers of a recording that can be left out; map, rooms and doorways are always there."""
MOST_WORKERS = 1024
"""Far more than there are processors in one machine; slips of the keyboard are not."""
Type = TypeVar("Type", bound=type)
BOTH = ("analyze", "batch")
MAPS, OUTPUTS, METHOD = "Which maps", "What to write", "Method and parameters"
"""Groups of options in the help."""


KINDS: dict[str, tuple[type, str]] = {"bool": (bool, "True or False"), "str": (str, "a text")}
"""Types of options that are checked as they are, and what they are called."""


@dataclass(frozen=True)
class Option:
    """What is known of an option besides its name, type and default.

    Attributes
    ----------
    help : str
        What it does and when it is useful, in plain English and with its unit.
    panel : str
        Group in the help.
    commands : tuple of str
        Commands that have it; an option for programs alone has none.
    flag : str
        On the command line; by default the name with dashes. The flag of an option that is on by default
        turns it off, and begins with ``--no-``.
    metavar : str
        Placeholder of the value in the help.
    low, high : float
        Bounds of a number, both allowed.
    choices : tuple of str
        All values, where these are a few names.
    parse : callable, optional
        Makes the value from a text, where the command line takes one in its place.
    text : str
        That text for the default.
    decides : bool
        Whether what is found in the maps depends on it, and not only what is written about it.
    """

    help: str
    panel: str = "Options"
    commands: tuple[str, ...] = ()
    flag: str = ""
    metavar: str = ""
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    parse: Callable[[str], Any] | None = None
    text: str = ""
    decides: bool = False


def option(default: Any, help: str, **about: Any) -> Any:
    """Declare an option of a dataclass; a default that is a class is called for the value."""
    known = {"option": Option(help, **about)}
    if isinstance(default, type):
        return field(default_factory=default, metadata=known)
    return field(default=default, metadata=known)


def options_of(kind: Any) -> dict[str, Option]:
    """List the options of a dataclass by name."""
    return {each.name: each.metadata["option"] for each in dataclasses.fields(kind) if each.metadata}


def explained(kind: Type) -> Type:
    """Add the options of a dataclass to its docstring."""
    lines = [kind.__doc__ or "", "    Attributes", "    ----------"]
    for each in dataclasses.fields(kind):
        if each.metadata:
            default = "" if each.default is dataclasses.MISSING else f", default {each.default!r}"
            lines += [f"    {each.name} : {each.type}{default}", f"        {each.metadata['option'].help}"]
    kind.__doc__ = "\n".join(lines) + "\n    "
    return kind


def check_options(given: Any) -> None:
    """Check numbers against their bounds and names against the choices.

    Parameters
    ----------
    given : dataclass
        With options; None is right where it is the default.

    Raises
    ------
    ParameterError
        That names the first option whose value cannot be used.
    """
    for each in dataclasses.fields(given):
        value = getattr(given, each.name)
        if each.metadata:
            _check(each, value)


def check_option(kind: Any, name: str, value: Any) -> None:
    """Check the value of one option of a dataclass as `check_options` does."""
    _check(next(each for each in dataclasses.fields(kind) if each.name == name), value)


def _check(declared: dataclasses.Field[Any], value: Any) -> None:
    about: Option = declared.metadata["option"]
    if value is None and declared.default is None:
        return
    kind = KINDS.get(str(declared.type).removesuffix(" | None"))
    if kind is not None and not isinstance(value, kind[0]):
        raise ParameterError(f"{declared.name}={value!r}: it must be {kind[1]}")
    if about.choices and value not in about.choices:
        raise ParameterError(f"{declared.name}={value!r}: it must be one of {', '.join(about.choices)}")
    if about.low == -math.inf and about.high == math.inf:
        return
    is_whole = "int" in str(declared.type)
    is_number = isinstance(value, Integral if is_whole else Real) and value is not True and value is not False
    if not is_number or not about.low <= value <= about.high:
        what = "a whole number" if is_whole else "a number"
        bounds = f"{about.low:g} or more" if about.high == math.inf else f"{about.low:g} to {about.high:g}"
        raise ParameterError(f"{declared.name}={value!r}: it must be {what}, {bounds}")


def layers_named(text: str) -> tuple[str, ...]:
    """Read which layers of a recording are wanted.

    Parameters
    ----------
    text : str
        ``all``, ``none``, or names among `RECORDING_LAYERS` with commas between them.

    Raises
    ------
    ParameterError
        If there is no such layer.
    """
    if text in ("all", "none"):
        return RECORDING_LAYERS if text == "all" else ()
    asked = [name.strip() for name in text.split(",")]
    if unknown := [name for name in asked if name not in RECORDING_LAYERS]:
        raise ParameterError(
            f"layers={unknown[0]!r}: there is no such layer; there are: all, none, "
            f"{', '.join(RECORDING_LAYERS)}"
        )
    return tuple(name for name in RECORDING_LAYERS if name in asked)


def with_detail(parameters: Parameters, detail: float | None, method: str = METHODS[0]) -> Parameters:
    """Set the parameter `regions.detail` to what was asked for; None leaves it as it is.

    Raises
    ------
    ParameterError
        If it is out of bounds, or the rooms do not depend on it.
    """
    if detail is None:
        return parameters
    check_option(RunOptions, "detail", detail)
    if method != METHODS[0] or parameters.floor_plan.grouping != "fitted":
        raise ParameterError(
            f"detail={detail:g}: only method={METHODS[0]!r} with floor_plan.grouping='fitted' has it"
        )
    return parameters.replaced({"regions.detail": float(detail)})


@explained
@dataclass(frozen=True)
class RunOptions:
    """What to take from a log, how to analyze it, what to write.

    Everything has a default.

    Raises
    ------
    ParameterError
        If a value cannot be used; the message names the option.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> rl.RunOptions(method="voronoi", every_s=5.0).selection.every_s
    5.0
    """

    topic: str | None = option(
        None,
        "Topic of the maps. By default /map, or the only topic that holds maps.",
        panel=MAPS,
        commands=("batch",),
        metavar="NAME",
        decides=True,
    )
    message_type: str | None = option(
        None,
        "Type of the maps on channels without a schema, which do not say it themselves: "
        f"{', '.join(TYPES_WITHOUT_SCHEMA[1:])}.",
        panel=MAPS,
        commands=BOTH,
        flag="--type",
        metavar="NAME",
        choices=TYPES_WITHOUT_SCHEMA[1:],
        decides=True,
    )
    part: int | None = option(
        None,
        "Which part of the maps to take alone, from 1, where the map was begun anew or several nodes publish "
        "on the topic. By default all that were begun anew, each with its own coverage and tracks; of "
        "several nodes the one that tells most.",
        panel=MAPS,
        commands=BOTH,
        metavar="N",
        low=1,
        high=1e6,
        decides=True,
    )
    map_from: str | None = option(
        None,
        "Topic of laser scans (LaserScan or MultiEchoLaserScan): build the maps from these and the log's "
        "transforms, for a log without maps. Cells and ranges are parameters, as in "
        "mapping.resolution_m=0.1.",
        panel=MAPS,
        commands=BOTH,
        metavar="NAME",
        decides=True,
    )
    map_frame: str | None = option(
        None,
        "Frame of maps that are built from scans, in which the building stands still. By default map, else "
        "odom, with a warning.",
        panel=MAPS,
        commands=BOTH,
        metavar="FRAME",
        decides=True,
    )
    start_s: float | None = option(
        None,
        "Skip the first S seconds of the log. Times in the results count from the first map instead.",
        panel=MAPS,
        commands=BOTH,
        flag="--start",
        metavar="S",
        low=0.0,
        high=LONGEST_LOG_S,
        decides=True,
    )
    end_s: float | None = option(
        None,
        "Stop S seconds after the beginning of the log, not of its maps.",
        panel=MAPS,
        commands=BOTH,
        flag="--end",
        metavar="S",
        low=0.0,
        high=LONGEST_LOG_S,
        decides=True,
    )
    every_s: float | None = option(
        None,
        "Minimum seconds between maps: for logs with a map several times a second.",
        panel=MAPS,
        commands=BOTH,
        flag="--every",
        metavar="S",
        low=0.0,
        high=LONGEST_LOG_S,
        decides=True,
    )
    min_change_m2: float | None = option(
        None,
        "Minimum area, in square meters, that changed between known and unknown since the map before: skips "
        "maps that are recorded while the robot stands still.",
        panel=MAPS,
        commands=BOTH,
        flag="--min-change",
        metavar="M2",
        low=0.0,
        high=1e12,
        decides=True,
    )
    max_snapshots: int | None = option(
        None,
        "Maximum number of maps, evenly spaced: for a quick look at a long log.",
        panel=MAPS,
        commands=BOTH,
        metavar="N",
        low=1,
        decides=True,
    )
    base_frame: str | None = option(
        None,
        "Frame of the robot's base, whose way the recording and the annotated MCAP show. By default "
        "base_link, base_footprint or the like, or the only frame below odom.",
        panel=OUTPUTS,
        commands=BOTH,
        metavar="NAME",
    )
    names: str | None = option(
        None,
        "Names of rooms: a table (CSV) with the columns name and track, or name, x and y in meters of the "
        "last map; or GeoJSON or DXF with named outlines, which is laid over it. All outputs have them.",
        panel=OUTPUTS,
        commands=("analyze",),
        metavar="FILE",
    )
    method: str = option(
        "rose2",
        f"Segmentation method: {METHODS[0]}, or one that it is compared with, {', '.join(METHODS[1:])}.",
        panel=METHOD,
        commands=BOTH,
        metavar="NAME",
        choices=METHODS,
        decides=True,
    )
    parameters: Parameters = option(  # noqa: RUF009 (it calls `field`)
        Parameters, "Parameters of all stages.", panel=METHOD, decides=True
    )
    detail: float | None = option(
        None,
        "How finely to divide open floor into rooms. 0, the default, parts what is likelier two rooms than "
        "one; positive gives more and smaller rooms, negative fewer and larger ones. In log odds: 2 is a "
        "clear change, 5 a strong one.",
        panel=METHOD,
        commands=BOTH,
        metavar="X",
        low=-DETAIL_MOST,
        high=DETAIL_MOST,
    )
    workers: int = option(
        1,
        "Number of processes that analyze maps at the same time, at most two for each processor. Results do "
        "not depend on it.",
        panel=METHOD,
        commands=("analyze",),
        metavar="N",
        low=1,
        high=MOST_WORKERS,
    )
    recording: bool = option(
        True, "Write the Rerun recording.", panel=OUTPUTS, commands=BOTH, flag="--no-rrd"
    )
    layers: tuple[str, ...] = option(
        RECORDING_LAYERS,
        "What the recording shows besides map, rooms and doorways: all, none, or names with commas between "
        f"them, of {', '.join(RECORDING_LAYERS)}.",
        panel=OUTPUTS,
        commands=BOTH,
        metavar="NAMES",
        parse=layers_named,
        text="all",
    )
    annotated_log: bool = option(
        True, "Write the annotated MCAP.", panel=OUTPUTS, commands=BOTH, flag="--no-mcap"
    )
    bag: bool = option(
        False,
        "Also write metadata.yaml, which makes the folder a ROS 2 bag: `ros2 bag play` plays the annotated "
        "MCAP.",
        panel=OUTPUTS,
        commands=BOTH,
    )
    back_project: bool = option(
        False,
        "Read the maps again and measure how much of each room of the last map every earlier map shows: "
        "in back_projected.parquet, a tab of the recording, a section of the report.",
        panel=OUTPUTS,
        commands=BOTH,
    )
    live: bool = option(
        False,
        "Also show the run in a Rerun viewer while it is analyzed; one is started if none is open.",
        panel=OUTPUTS,
        commands=("analyze",),
    )
    overwrite: bool = option(
        False, "Replace the results of an earlier run.", panel=OUTPUTS, commands=("analyze",)
    )
    resume: bool = option(
        False,
        "Continue a run of the same log and options that was stopped, after its last map. Complete results "
        "are left as they are.",
        panel=OUTPUTS,
        commands=("analyze",),
    )
    strict: bool = option(
        False,
        "Stop at the first warning about the log. By default everything that can be read is analyzed.",
        panel=MAPS,
        commands=BOTH,
    )
    journal: bool = option(True, "Keep what is found on the way, so that a stopped run can be resumed.")
    origin: str | None = option(
        None, "What the summary names as the log, for a log that was copied to be read; by default its path."
    )

    def __repr__(self) -> str:
        return changed_text(self)

    def __post_init__(self) -> None:
        check_options(self)
        # A text, as the command line has it, is a right value for programs too.
        layers: Any = self.layers
        if not isinstance(layers, str):
            if not isinstance(layers, Collection) or not all(isinstance(each, str) for each in layers):
                raise ParameterError(f"layers={layers!r}: they must be a text or a sequence of names")
            layers = ",".join(layers) or "none"
        layers = layers_named(layers)
        object.__setattr__(self, "layers", layers)
        parameters = with_detail(self.parameters, self.detail, self.method)
        object.__setattr__(self, "parameters", parameters)
        if self.names is not None:
            object.__setattr__(self, "names", str(expanded(Path(self.names))))
        if self.bag and not self.annotated_log:
            raise ParameterError(
                "bag=True makes a ROS 2 bag of the annotated MCAP, which annotated_log=False leaves out"
            )
        if self.topic is not None and self.map_from is not None:
            raise ParameterError(
                f"topic={self.topic!r} reads recorded maps, map_from={self.map_from!r} builds them; give one "
                "of the two"
            )
        if self.map_frame is not None and self.map_from is None:
            raise ParameterError(
                f"map_frame={self.map_frame!r} is for maps built from scans; give their topic, too "
                "(map_from='/scan')"
            )
        if self.start_s is not None and self.end_s is not None and self.start_s > self.end_s:
            raise ParameterError(f"start_s={self.start_s:g}: it lies after end_s={self.end_s:g}")

    @property
    def reading(self) -> ReadingParameters:
        """Parameters of reading, with the type that was named."""
        return self.parameters.reading.with_type(self.message_type)

    @property
    def selection(self) -> Selection:
        """Which maps of the log to take."""
        from rose2_logs.config.selection import Selection  # brings NumPy, which a command's help does without

        names = ("start_s", "end_s", "every_s", "min_change_m2", "max_snapshots")
        return Selection(**{name: getattr(self, name) for name in names})

    @property
    def shown_layers(self) -> tuple[str, ...]:
        """The layers that a recording, stored or live, is going to show."""
        return self.layers if self.recording or self.live else ()

    def deciding(self) -> dict[str, Any]:
        """Return the options on which it depends what is found in the maps, as JSON values."""
        values = {name: getattr(self, name) for name, about in options_of(self).items() if about.decides}
        return values | {"parameters": self.parameters.resolved()}
