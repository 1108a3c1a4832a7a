"""Executes the plan's steps when their frames come, and receives every event."""
from __future__ import annotations

import time

import dtact
from clients import TIMEOUT_S


class Commander:
    """`note(text)` receives faults. `answers`: how many requests were answered."""

    def __init__(self, address, calibration, note):
        self._client = dtact.connect(address, program="soak commander", timeout=TIMEOUT_S)
        self._client.subscribe(dtact.Subscription(depth=None, summary=True, summary_hz=30))
        self._files = dtact.CalibrationFiles.read(calibration)
        self._note = note
        self.sequence = 0
        self.answers = 0
        self.events: list[tuple[int, str, object]] = []  #: sequence, kind, event

    def listen(self, seconds):
        """Reads messages for `seconds`."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            item = self._client.next(timeout=left)
            if isinstance(item, dtact.Frame):
                self.sequence = max(self.sequence, item.sequence)
            elif item is not None:
                self._heard(item)

    def _heard(self, event):
        kind = type(event).__name__.removesuffix("Event").lower()
        self.events.append((event.sequence, kind, event))
        # No frame comes while the camera is away, but events do.
        self.sequence = max(self.sequence, event.sequence)

    def in_time(self, step) -> bool:
        return self.sequence < step.latest

    def do(self, step) -> tuple[bool, float]:
        """Whether it was answered in time to be judged, and the seconds that the answer took."""
        refused = None
        began = time.monotonic()
        try:
            getattr(self, step.verb)(step)
        except dtact.Refused as problem:
            refused = problem
        took = time.monotonic() - began
        self.answers += 1
        self.listen(0.05)
        in_time = self.in_time(step)
        if refused and in_time:
            self._note(f"{step.verb} at frame {step.sequence} was refused: {refused}")
        return in_time, took

    def light(self, step):
        shown = self._client.set_light(brightness=step.value)
        if shown.brightness != step.value:
            self._note(f"light {step.value} was asked for and {shown.brightness} answered")

    def rezero(self, step):
        self._client.rezero(force=step.value)

    def rezero_refused(self, step):
        try:
            self._client.rezero()
        except dtact.InContact:
            return
        self.listen(0.1)
        if self.in_time(step):
            self._note(f"a re-zero at frame {step.sequence} was not refused although in contact")

    def upload(self, _step):
        if self._client.upload_calibration(self._files) is None:
            self._note("an uploaded calibration got no number")

    def activate(self, step):
        self._client.activate_calibration(step.value)

    def upload_broken(self, _step):
        before = self._client.status().calibration
        half = self._files.reference_png[: len(self._files.reference_png) // 2]
        try:
            self._client.upload_calibration(
                dtact.CalibrationFiles("broken", self._files.calibration_toml, half))
        except dtact.Invalid:
            pass
        else:
            self._note("a calibration with half of its reference was not refused")
        if self._client.status().calibration != before:
            self._note("a refused calibration is in use")

    def status(self):
        self.answers += 1
        return self._client.status()

    def close(self):
        self._client.close()
