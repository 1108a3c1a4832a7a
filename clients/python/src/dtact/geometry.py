"""Points of the surface, and what dtact-perceive adds to a frame: the motion of the object in contact."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import ProtocolError
from .messages import Message, name_of

_PARTS = 6  # x, y, z and the normal's
_HOLE = -32768
_REACH_MM = 0.16  # CloudMaker::kReachMm of clients/geometry/point_cloud.hpp


def _slope(depth: NDArray[np.float32], step: float, reach: int) -> NDArray[np.float64]:
    """Of the indentation along the rows, between the farthest pixels on both sides that are there, at
    most `reach` away. NaN where there is none, and where `depth` is."""
    begin, end = np.array(depth, np.float64), np.array(depth, np.float64)
    far = np.zeros((2, *depth.shape), int)
    for i in range(1, min(reach, depth.shape[1] - 1) + 1):
        left, right = ~np.isnan(depth[:, :-i]), ~np.isnan(depth[:, i:])
        begin[:, i:][left] = depth[:, :-i][left]
        far[0][:, i:][left] = i
        end[:, :-i][right] = depth[:, i:][right]
        far[1][:, :-i][right] = i
    distance = far.sum(axis=0) * step
    slope: NDArray[np.float64] = np.full(depth.shape, np.nan)
    np.divide(end - begin, distance, out=slope, where=distance > 0)
    slope[np.isnan(depth)] = np.nan
    return slope


@dataclass(frozen=True)
class Surface:
    """The undeformed gel's surface, in the surface frame: z towards the object, the surface through
    the origin. The camera looks along z through air and through the flat back of the gel, where rays
    are refracted."""

    shape: str  #: "plane", "sphere" or "cylinder"
    radius_mm: float = 0.0  #: of a sphere, its centre at (0, 0, −radius_mm), or a cylinder
    axis_deg: float = 0.0  #: of a cylinder, from x towards y
    air_mm: float = 0.0  #: from the camera's pinhole to the gel
    gel_mm: float = 0.0  #: from there to the surface's origin
    refraction: float = 1.0  #: of the gel
    foot_mm: tuple[float, float] = (0.0, 0.0)  #: of a plane: of the camera's axis
    per_mm: float = 0.0  #: of a plane: 1 / the camera's height above it; 0: unknown

    @classmethod
    def of(cls, m: Message) -> Surface:
        shape = name_of("Surface.Shape", m.shape, "")
        if shape == "plane":
            return cls(shape, foot_mm=(float(m.foot_x_mm), float(m.foot_y_mm)),
                       per_mm=float(m.per_mm))
        return cls(shape, float(m.radius_mm), float(m.axis_deg), float(m.air_mm), float(m.gel_mm),
                   float(m.refraction))

    def place(self, x_mm: Any, y_mm: Any, depth_mm: Any) -> tuple[Any, Any]:
        """Where a point of a plane lies that a depth map shows at (x, y) and that is pressed in: nearer
        to the camera, it appears farther from the foot of the camera's axis than it is. Millimetres,
        surface frame; numbers or arrays."""
        share = self.per_mm * depth_mm
        return x_mm - share * (x_mm - self.foot_mm[0]), y_mm - share * (y_mm - self.foot_mm[1])


@dataclass(frozen=True)
class PointCloud:
    """The deformed surface as points with outward normals, on the depth map's grid."""

    points: NDArray[np.float32]  #: (H, W, 3) metres in the surface frame; NaN where there is none
    normals: NDArray[np.float32]  #: (H, W, 3) of length 1; NaN where there is no point
    decimation: int  #: pixels of the calibration's resolution per point, along each side
    made_in_s: float = 0.0  #: computation time

    @classmethod
    def of(cls, m: Message) -> PointCloud:
        """ProtocolError where the data do not fit the sizes."""
        size = _PARTS * m.width * m.height
        kinds: dict[int, np.dtype[Any]] = {1: np.dtype("<f4"), 2: np.dtype("<i2")}
        kind = kinds.get(m.encoding)
        if kind is None or len(m.data) != size * kind.itemsize:
            raise ProtocolError("a point cloud of dtact-perceive is damaged or in an unknown encoding: "
                                "install the same release on both sides")
        parts = np.frombuffer(m.data, kind).reshape(_PARTS, m.height, m.width)
        values = np.moveaxis(parts, 0, -1).astype(np.float32)
        if m.encoding == 2:
            values[values == _HOLE] = np.nan
            values *= np.array([m.metres_per_unit] * 3 + [1 / 32767] * 3, np.float32)
        return cls(values[..., :3], values[..., 3:], int(m.decimation) or 1,
                   m.make_ns * 1e-9)

    @classmethod
    def of_plane(cls, depth_mm: NDArray[np.float32], mm_per_px: float, origin_px: tuple[int, int],
                 full_shape: tuple[int, int], decimation: int,
                 surface: Surface = Surface("plane")) -> PointCloud:
        """Of a depth map of a flat gel: the columns and rows from `origin_px` of a map of `full_shape`,
        at their true places. Normals are taken over 0.16 mm on both sides, or to the last trusted pixel."""
        height, width = depth_mm.shape
        columns = origin_px[0] + np.arange(width) - 0.5 * (full_shape[1] - 1)
        rows = origin_px[1] + np.arange(height) - 0.5 * (full_shape[0] - 1)
        reach = max(1, round(_REACH_MM / mm_per_px))
        slope_x = _slope(depth_mm, mm_per_px, reach)
        slope_y = _slope(depth_mm.T, mm_per_px, reach).T
        x, y = np.meshgrid(columns * mm_per_px, rows * mm_per_px)
        # With the slopes in places as they appear, the surface has the tangents
        # (rest − leans_x slope_x, −leans_y slope_x, −slope_x) and (−leans_x slope_y, rest − leans_y slope_y,
        # −slope_y); this is their cross product over rest.
        leans_x, leans_y = (surface.per_mm * (at - foot) for at, foot in zip((x, y), surface.foot_mm))
        rest = 1 - surface.per_mm * depth_mm
        normals = np.stack([slope_x, slope_y, rest - leans_x * slope_x - leans_y * slope_y], axis=-1)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        points = np.stack([*surface.place(x, y, depth_mm), -depth_mm], axis=-1)
        points[np.isnan(normals[..., 2])] = np.nan
        return cls((points * 1e-3).astype(np.float32), normals.astype(np.float32), decimation)

    @property
    def valid(self) -> NDArray[np.bool_]:
        """(H, W): where there is a point."""
        return np.asarray(~np.isnan(self.points[..., 2]))

    def triangles(self) -> NDArray[np.int64]:
        """The mesh: (N, 3) indices into `points.reshape(-1, 3)`, counter-clockwise as seen from
        outside; two for each square of neighbours, as far as their points are there."""
        height, width = self.points.shape[:2]
        index = np.arange(height * width).reshape(height, width)
        corner, right = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
        below, across = index[1:, :-1].ravel(), index[1:, 1:].ravel()
        all_of_them = np.concatenate([np.stack([corner, right, below], 1),
                                      np.stack([right, across, below], 1)])
        return np.asarray(all_of_them[self.valid.ravel()[all_of_them].all(1)])


@dataclass(frozen=True)
class ObjectPose:
    """Motion of the object since contact began, in the surface frame: its point p is now at
    `matrix() @ (p, 1)`, in millimetres. For a known object (`object`), p is in the frame of its
    file."""

    #: "started", "tracked", "lost" (the last one is repeated), "recovered", or "searching" (for a known
    #: object: there is no motion)
    tracking: str
    since_sequence: int  #: the frame that it is measured from
    translation_mm: NDArray[np.float64]
    rotation_deg: NDArray[np.float64]  #: axis times angle
    #: (N, 6) unit twists about `centre_mm` that the shape does not show: rotation times `arm_mm`,
    #: then translation. Along them the motion is not known.
    unobservable: NDArray[np.float64]
    centre_mm: NDArray[np.float64]
    arm_mm: float
    residual_um: float  #: root mean square along the normals
    points: int  #: that count
    object: str = ""  #: the known object's name; empty: the motion since the contact was made
    alternatives: int = 0  #: other placements of the known object that explain the contact as well
    followed_in_s: float = 0.0  #: processing time
    valid: bool = False  #: the motion of this frame is known: started, tracked or recovered

    @classmethod
    def of(cls, m: Message) -> ObjectPose:
        def vector(v: Message) -> list[float]:
            return [v.x, v.y, v.z]

        hidden = [vector(t.rotation) + vector(t.translation) for t in m.unobservable]
        return cls(name_of("ObjectPose.Tracking", m.tracking, ""), int(m.since_sequence),
                   np.array(vector(m.translation_mm)), np.array(vector(m.rotation_deg)),
                   np.array(hidden).reshape(-1, 6), np.array(vector(m.centre_mm)),
                   float(m.arm_mm), float(m.residual_um), int(m.points), str(m.object),
                   int(m.alternatives), m.track_ns * 1e-9, bool(m.valid))

    def matrix(self) -> NDArray[np.float64]:
        """4 × 4, millimetres."""
        angle = np.radians(np.linalg.norm(self.rotation_deg))
        made = np.eye(4)
        if angle > 0:
            x, y, z = np.radians(self.rotation_deg) / angle
            cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            # Rodrigues' formula.
            made[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        made[:3, 3] = self.translation_mm
        return made
