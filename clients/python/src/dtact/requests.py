"""Each request: what is sent, and what the answer means. Both clients use them."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Callable, Generic, Sequence, TypeVar

from .messages import ClientMessage, Message
from .subscription import Subscription
from .values import (
    CalibrationFiles,
    CameraSettings,
    Light,
    Pong,
    Reconstruction,
    ReferenceImage,
    Server,
    Status,
    StoredCalibration,
    wall_time,
)

T = TypeVar("T")

MAJOR, MINOR = 1, 1  # kMajor and kMinor of proto/defaults.hpp
MAX_PROGRAM_BYTES = 64


@dataclass(frozen=True)
class Request(Generic[T]):
    """`answer` makes of the Reply what the caller gets."""

    message: Message
    answer: Callable[[Message], T]
    #: Calibrations are parsed, and some written to a disk, before the request is answered.
    slow: bool = False
    #: Frames are averaged before the request is answered.
    averages: bool = False
    #: Subscribes as before: frames not taken yet are kept.
    again: bool = False


def _nothing(reply: Message) -> None:
    return None


def _cut(text: str, most: int) -> str:
    return text.encode()[:most].decode(errors="ignore")


def hello(program: str, token: str | None) -> Request[Server]:
    message = ClientMessage()
    message.hello.major, message.hello.minor = MAJOR, MINOR
    message.hello.program = _cut(program, MAX_PROGRAM_BYTES)
    if token is not None:
        message.hello.token = token
    return Request(message, lambda reply: Server.of(reply.hello))


def subscribe(subscription: Subscription, same_machine: bool, again: bool = False) -> Request[None]:
    message = ClientMessage()
    message.subscribe.CopyFrom(subscription.message(same_machine))
    return Request(message, _nothing, again=again)


def unsubscribe() -> Request[None]:
    message = ClientMessage()
    message.subscribe.SetInParent()
    return Request(message, _nothing)


def set_light(brightness: int | None, scheme: str | None,
              leds: Sequence[tuple[int, int, int]] | None) -> Request[Light]:
    message = ClientMessage()
    request = message.set_light
    request.SetInParent()
    if brightness is not None:
        request.brightness = brightness
    if scheme is not None:
        request.scheme = scheme
    for r, g, b in leds or ():
        request.leds.add(r=r, g=g, b=b)
    return Request(message, lambda reply: Light.of(reply.light))


def set_camera(exposure_us: float | None, gain: float | None) -> Request[CameraSettings]:
    message = ClientMessage()
    request = message.set_camera
    request.SetInParent()
    if exposure_us is not None:
        request.exposure_us = exposure_us
    if gain is not None:
        request.gain = gain
    return Request(message, lambda reply: CameraSettings.of(reply.camera))


def set_reconstruction(resolution: str | None, sharpen: str | None,
                       max_error_um: float | None) -> Request[Reconstruction]:
    message = ClientMessage()
    request = message.set_reconstruction
    request.SetInParent()
    if resolution is not None:
        request.resolution = resolution
    if sharpen is not None:
        request.sharpen = sharpen
    if max_error_um is not None:
        request.max_error_um = max_error_um
    return Request(message, lambda reply: Reconstruction.of(reply.reconstruction))


def rezero(force: bool) -> Request[None]:
    message = ClientMessage()
    message.rezero.force = force
    return Request(message, _nothing, averages=True)


def status() -> Request[Status]:
    message = ClientMessage()
    message.get_status.SetInParent()
    return Request(message, lambda reply: Status.of(reply.status))


def calibration(number: int | None) -> Request[CalibrationFiles]:
    message = ClientMessage()
    message.get_calibration.SetInParent()
    if number is not None:
        message.get_calibration.number = number

    def answer(reply: Message) -> CalibrationFiles:
        m = reply.calibration
        return CalibrationFiles(m.name, m.calibration_toml, m.reference_png,
                                m.number if m.HasField("number") else None)

    return Request(message, answer)


def calibrations() -> Request[list[StoredCalibration]]:
    message = ClientMessage()
    message.list_calibrations.SetInParent()
    return Request(message,
                   lambda reply: [StoredCalibration.of(m) for m in reply.calibrations.calibrations],
                   slow=True)


def upload_calibration(files: CalibrationFiles) -> Request[int]:
    message = ClientMessage()
    request = message.upload_calibration
    request.name = files.name
    request.calibration_toml = files.calibration_toml
    request.reference_png = files.reference_png
    return Request(message, lambda reply: int(reply.done.calibration), slow=True)


def activate_calibration(number: int) -> Request[None]:
    message = ClientMessage()
    message.activate_calibration.number = number
    return Request(message, _nothing, slow=True)


def pin_calibration(number: int, pinned: bool) -> Request[None]:
    message = ClientMessage()
    message.pin_calibration.number = number
    message.pin_calibration.pinned = pinned
    return Request(message, _nothing)


def reference() -> Request[ReferenceImage]:
    message = ClientMessage()
    message.get_reference.SetInParent()

    def answer(reply: Message) -> ReferenceImage:
        m = reply.reference
        number = m.calibration if m.HasField("calibration") else None
        return ReferenceImage(m.png, Light.of(m.light), m.sequence, number)

    return Request(message, answer)


def ping(clock: Callable[[], float]) -> Request[Pong]:
    message = ClientMessage()
    message.ping.SetInParent()
    sent = clock()

    def answer(reply: Message) -> Pong:
        m = reply.pong
        return Pong(m.monotonic_ns * 1e-9, wall_time(m.wall_ns), clock() - sent)

    return Request(message, answer)
