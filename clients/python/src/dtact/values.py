"""What frames, events and answers hold besides pixels. Millimetres are of the surface frame: origin
at the centre of the depth map, x to the right, y down, as the camera sees it."""
from __future__ import annotations

import os
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Iterable

from .messages import Message, name_of

_EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)


def wall_time(nanoseconds: int) -> datetime:
    """Nanoseconds since 1970 as a datetime in UTC, rounded down to microseconds."""
    return _EPOCH + timedelta(microseconds=nanoseconds // 1000)


def health_names(health: Iterable[int]) -> tuple[str, ...]:
    """The `health` of a message: HEALTH_LIGHT_UNSETTLED → "light_unsettled"."""
    return tuple(name_of("Health", value) for value in health)


@dataclass(frozen=True)
class Contact:
    """Summary of the contact."""

    in_contact: bool
    area_mm2: float  #: pressed deeper than `threshold_mm`
    x_mm: float  #: depth-weighted centroid
    y_mm: float
    deepest_mm: float
    deepest_x_mm: float
    deepest_y_mm: float
    volume_mm3: float
    #: Newtons along the surface's normal, 0 without contact; None: `force_absence` says why.
    force_n: float | None = None
    force_uncertainty_n: float | None = None  #: mean absolute error to expect of it
    force_absence: str = "none"  #: "none", "uncalibrated", "beyond_calibration", "cut_off"
    threshold_mm: float = 0.0  #: the contact threshold

    @property
    def force_valid(self) -> bool:
        """Whether there is a force."""
        return self.force_n is not None

    @classmethod
    def of(cls, m: Message) -> Contact:
        valid = m.HasField("force_n")
        return cls(m.in_contact, m.area_mm2, m.x_mm, m.y_mm, m.deepest_mm, m.deepest_x_mm,
                   m.deepest_y_mm, m.volume_mm3, m.force_n if valid else None,
                   m.force_uncertainty_n if valid else None,
                   name_of("ForceAbsence", m.force_absence, "FORCE_ABSENCE_"), m.threshold_mm)


@dataclass(frozen=True)
class Candidate:
    """An object that a contact may be of."""

    name: str
    probability: float
    taught: bool  #: by a user; else built in


@dataclass(frozen=True)
class Recognition:
    """What the object in contact is, as far as dtact-perceive knows."""

    #: "known" (the first candidate), "unknown" (none of them), "unsure", "too_shallow" or "cut_off"
    verdict: str
    candidates: tuple[Candidate, ...]  #: most probable first, whatever the verdict
    score: float  #: probability that it is a known object at all
    presses: int  #: contacts joined; 0: none is deep enough
    model: str  #: SHA-256 of the network's weights
    sequence: int  #: the last frame of it
    computed_in_s: float

    @property
    def name(self) -> str | None:
        """The object's name when it is known."""
        return self.candidates[0].name if self.verdict == "known" else None

    @classmethod
    def of(cls, m: Message) -> Recognition:
        return cls(name_of("Recognition.Verdict", m.verdict, ""),
                   tuple(Candidate(str(c.name), float(c.probability), bool(c.taught))
                         for c in m.candidates),
                   float(m.score), int(m.presses), str(m.model), int(m.sequence), m.took_ns * 1e-9)


@dataclass(frozen=True)
class Light:
    """The ring."""

    brightness: int  #: 0 … 255
    leds: tuple[tuple[int, int, int], ...]  #: eight colours (r, g, b) of 0 … 255
    #: Since when frames are exposed under this light: the daemon's CLOCK_MONOTONIC, seconds. None
    #: while unknown.
    since_s: float | None

    @classmethod
    def of(cls, m: Message) -> Light:
        leds = tuple((led.r, led.g, led.b) for led in m.leds)
        return cls(m.brightness, leds, m.since_ns * 1e-9 if m.HasField("since_ns") else None)


@dataclass(frozen=True)
class Reconstruction:
    """How depth is made; dtactd.toml explains the words under [reconstruction]."""

    resolution: str  #: "full", "half", "quarter", "auto"
    sharpen: str  #: "off", "1", "2", "auto"
    max_error_um: float  #: 1 … 10000, for "auto"

    @classmethod
    def of(cls, m: Message) -> Reconstruction:
        return cls(m.resolution, m.sharpen, m.max_error_um)


@dataclass(frozen=True)
class CameraSetting:
    """A number that can be changed while the camera runs."""

    value: float
    minimum: float
    maximum: float


@dataclass(frozen=True)
class CameraSettings:
    """What can be changed of the camera; None where it has no such control."""

    exposure_us: CameraSetting | None
    gain: CameraSetting | None  #: in the camera's own unit

    @classmethod
    def of(cls, m: Message) -> CameraSettings:
        def setting(name: str) -> CameraSetting | None:
            one = getattr(m, name)
            return CameraSetting(one.value, one.minimum, one.maximum) if m.HasField(name) else None

        return cls(setting("exposure_us"), setting("gain"))


@dataclass(frozen=True)
class CalibrationSummary:
    """What a calibration is made for."""

    name: str
    method: str  #: "lut" or "published"
    mm_per_px: float
    width: int  #: of the depth map at full resolution, pixels
    height: int
    covered_from_mm: float
    covered_to_mm: float
    created: str  #: ISO 8601
    frame_width: int  #: of the camera's picture, pixels
    frame_height: int

    @classmethod
    def of(cls, m: Message) -> CalibrationSummary:
        return cls(m.name, m.method, m.mm_per_px, m.width, m.height, m.covered_from_mm,
                   m.covered_to_mm, m.created, m.frame_width, m.frame_height)


@dataclass(frozen=True)
class StoredCalibration:
    """One of the calibrations that the daemon has."""

    number: int  #: 0 is the one of the configuration file; uploaded ones count from 1
    name: str
    uploaded: str  #: ISO 8601, UTC; empty for number 0
    current: bool  #: what the daemon starts with
    in_use: bool
    summary: CalibrationSummary | None
    damage: str  #: why it cannot be read, or empty
    pinned: bool  #: the daemon does not remove it

    @classmethod
    def of(cls, m: Message) -> StoredCalibration:
        summary = CalibrationSummary.of(m.summary) if m.HasField("summary") else None
        return cls(m.number, m.name, m.uploaded, m.current, m.in_use, summary, m.damage,
                   m.pinned)


@dataclass(frozen=True)
class CalibrationFiles:
    """The files of one calibration, as `dtact-calibrate` writes them into a folder."""

    name: str
    calibration_toml: bytes
    reference_png: bytes
    number: int | None = None

    @classmethod
    def read(cls, folder: str | Path) -> CalibrationFiles:
        """From a folder, under its name."""
        folder = Path(folder)
        return cls(folder.resolve().name, (folder / "calibration.toml").read_bytes(),
                   (folder / "reference.png").read_bytes())

    def write(self, folder: str | Path) -> None:
        """Into a folder, which is made. Files there are replaced once both are written."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        files = {"calibration.toml": self.calibration_toml, "reference.png": self.reference_png}
        parts = {name: folder / f".{name}.{os.getpid()}.part" for name in files}
        try:
            for name, data in files.items():
                with parts[name].open("wb") as part:
                    part.write(data)
                    part.flush()
                    os.fsync(part.fileno())
            for name, path in parts.items():
                os.replace(path, folder / name)
        finally:
            for path in parts.values():
                path.unlink(missing_ok=True)


@dataclass(frozen=True)
class ReferenceImage:
    """The reference image that depth is measured against."""

    png: bytes  #: 16-bit grey, 256 units a grey level, the camera's size
    light: Light
    sequence: int  #: the last frame in it
    calibration: int | None


@dataclass(frozen=True)
class Pong:
    """The daemon's clocks, and how long the way there and back took."""

    monotonic_s: float
    time: datetime
    round_trip_s: float


@dataclass(frozen=True)
class Status:
    """How the daemon is. `message` holds all of dtact.proto's Status."""

    state: str  #: "settling", "referencing", "serving", "uncalibrated", "camera_lost"
    health: tuple[str, ...]
    fixes: dict[str, str]  #: for each flag of health: what it means and its fix
    advice: str  #: what to do about state and health; empty when all is well
    fps: float  #: over the last second
    light: Light
    calibration: CalibrationSummary | None
    version: str
    message: Message
    reconstruction: Reconstruction | None  #: None if the daemon does not report it
    board_celsius: float | None  #: of the daemon's computer; None where its kernel does not know it

    @classmethod
    def of(cls, m: Message) -> Status:
        calibration = CalibrationSummary.of(m.calibration) if m.HasField("calibration") else None
        health = health_names(m.health)
        return cls(name_of("State", m.state), health, dict(zip(health, m.fixes)), m.advice, m.fps,
                   Light.of(m.light), calibration, m.version, m,
                   Reconstruction.of(m.reconstruction) if m.HasField("reconstruction") else None,
                   m.board_celsius if m.HasField("board_celsius") else None)


@dataclass(frozen=True)
class Server:
    """The program that answered."""

    program: str
    major: int
    minor: int
    features: frozenset[str]  #: what it can do that others cannot; proto/README.md lists the names
    rights: str  #: "view", "control" or "calibrate"
    name: str
    serial: str  #: the camera's serial number; empty if it has none
    frame_id: str  #: id of the surface frame
    rezero_timeout_s: float = 0  #: longest time until the answer to a re-zero

    @classmethod
    def of(cls, m: Message) -> Server:
        return cls(m.program, m.major, m.minor, frozenset(m.features), name_of("Rights", m.rights),
                   m.name, m.serial, m.surface_frame.frame_id, m.rezero_timeout_s)
