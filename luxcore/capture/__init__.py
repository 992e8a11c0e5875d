"""Photos of a room become cameras, points and undistorted views in one layout."""

from luxcore.capture.export import export_capture
from luxcore.capture.ingest import ingest, placed_sentence
from luxcore.capture.points import Points, read_points, write_points
from luxcore.capture.pose_error import PoseError, pose_error
from luxcore.capture.rendered import from_rendered
from luxcore.capture.store import Capture, Frame, Skipped, View, load_capture, write_capture

__all__ = [
    "Capture",
    "Frame",
    "Points",
    "PoseError",
    "Skipped",
    "View",
    "export_capture",
    "from_rendered",
    "ingest",
    "load_capture",
    "placed_sentence",
    "pose_error",
    "read_points",
    "write_capture",
    "write_points",
]
