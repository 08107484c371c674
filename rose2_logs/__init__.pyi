from rose2_logs.api import (
    analyze as analyze,
)
from rose2_logs.api import (
    compare as compare,
)
from rose2_logs.api import (
    evaluate as evaluate,
)
from rose2_logs.api import (
    load as load,
)
from rose2_logs.api import (
    map_topics as map_topics,
)
from rose2_logs.api import (
    open_log as open_log,
)
from rose2_logs.api import (
    read_map as read_map,
)
from rose2_logs.api import (
    segment as segment,
)
from rose2_logs.api import (
    track as track,
)
from rose2_logs.comparison.layouts import LayoutComparison as LayoutComparison
from rose2_logs.config.parameters import Parameters as Parameters
from rose2_logs.config.run_options import RunOptions as RunOptions
from rose2_logs.config.selection import Selection as Selection
from rose2_logs.drawing.drawing import Drawing as Drawing
from rose2_logs.errors import (
    AlreadyWholeError as AlreadyWholeError,
)
from rose2_logs.errors import (
    CasesError as CasesError,
)
from rose2_logs.errors import (
    InvalidMapError as InvalidMapError,
)
from rose2_logs.errors import (
    LogError as LogError,
)
from rose2_logs.errors import (
    MissingPackageError as MissingPackageError,
)
from rose2_logs.errors import (
    NoMapTopicError as NoMapTopicError,
)
from rose2_logs.errors import (
    OutputError as OutputError,
)
from rose2_logs.errors import (
    ParameterError as ParameterError,
)
from rose2_logs.errors import (
    ResultsError as ResultsError,
)
from rose2_logs.errors import (
    Rose2LogsError as Rose2LogsError,
)
from rose2_logs.io.log import LogReader as LogReader
from rose2_logs.model.analysis import (
    FloorPlan as FloorPlan,
)
from rose2_logs.model.analysis import (
    SnapshotAnalysis as SnapshotAnalysis,
)
from rose2_logs.model.analysis import (
    Structure as Structure,
)
from rose2_logs.model.analysis import (
    Walls as Walls,
)
from rose2_logs.model.borders import Border as Border
from rose2_logs.model.occupancy import GridGeometry as GridGeometry
from rose2_logs.model.occupancy import OccupancySnapshot as OccupancySnapshot
from rose2_logs.model.room_plan import RoomPlan as RoomPlan
from rose2_logs.model.rooms import Doorway as Doorway
from rose2_logs.model.rooms import RoomMap as RoomMap
from rose2_logs.runs.history import RunSummary as RunSummary
from rose2_logs.runs.run import Run as Run
from rose2_logs.runs.run import RunSnapshot as RunSnapshot
from rose2_logs.runs.sink import RunInfo as RunInfo
from rose2_logs.runs.sink import Sink as Sink
from rose2_logs.runs.table import Table as Table
from rose2_logs.system.warnings import StrictError as StrictError
from rose2_logs.system.workers import WorkerError as WorkerError
from rose2_logs.tracking.tracked_snapshot import RoomEvent as RoomEvent
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot as TrackedSnapshot
from rose2_logs.workflows.evaluate import Evaluation as Evaluation
from rose2_logs.workflows.segment import Segmentation as Segmentation

__version__: str
__all__: list[str]
