#!/usr/bin/env python3
"""Checks who includes whom, against the folder map of ARCHITECTURE.md.

Each room names the rooms whose headers it may include; its own are always allowed. System and
library headers are checked for the rooms whose point is to know none.
"""
import pathlib
import re
import sys

ROOMS = {
    "hal/base": [],
    # File formats: neither devices nor tactile sensing.
    "hal/files": ["hal/base"],
    "hal/luma": ["hal"],
    "hal/mjpeg": ["hal"],
    "hal/null": ["hal", "hal/base"],
    "hal/replay": ["hal", "hal/base", "hal/files", "hal/luma", "hal/mjpeg"],
    "hal/sim": ["hal", "hal/base", "hal/files", "hal/luma", "hal/mjpeg"],
    "hal/live": ["hal", "hal/base", "hal/luma", "hal/mjpeg"],
    "hal/v4l2": ["hal", "hal/base", "hal/live"],
    "hal/libcamera": ["hal", "hal/base", "hal/live"],
    "hal/gpiod": ["hal", "hal/base"],
    "hal/ws2812": ["hal", "hal/base", "hal/gpiod"],
    # The registry is the only file that names backends.
    "hal": ["hal/null", "hal/replay", "hal/sim", "hal/v4l2", "hal/libcamera", "hal/ws2812"],
    "daemon/recon": [],
    "daemon/calibration": ["hal/base", "hal/files", "daemon/recon"],
    # The two rooms inside may use the pipeline's settings, health flags and the frame that it fills.
    "daemon/pipeline/reference": ["hal", "hal/base", "hal/files", "daemon/recon", "daemon/calibration", "daemon/pipeline"],
    "daemon/pipeline/depth": ["hal", "hal/base", "daemon/recon", "daemon/pipeline", "daemon/pipeline/reference"],
    "daemon/pipeline": ["hal", "hal/base", "daemon/recon", "daemon/calibration", "daemon/pipeline/reference", "daemon/pipeline/depth"],
    "daemon/serve": ["hal/base", "proto"],
    "daemon/net": ["daemon/serve", "hal", "hal/base", "hal/files", "proto", "daemon/pipeline", "daemon/calibration", "daemon/recon"],
    # Metrics are text of the network part's overview; only the assembly includes it.
    "daemon/metrics": ["hal/base", "daemon/net"],
    "daemon/announce": ["hal/base", "proto"],
    "daemon/app/doctor": ["hal", "hal/base", "hal/gpiod", "hal/v4l2", "hal/ws2812"],
    "daemon/app": ["hal", "hal/base", "hal/files", "daemon/calibration", "daemon/pipeline", "daemon/serve", "daemon/net", "daemon/metrics", "daemon/announce"],
    "daemon": ["daemon/app", "daemon/app/doctor"],
    "proto": [],
    "clients/cpp": ["hal/base", "proto"],
    # Only the surface's shape from the reconstruction.
    "clients/geometry": ["daemon/recon"],
    "clients/perceive/pose": ["clients/geometry"],
    "clients/perceive/recognition": ["clients/geometry", "hal/base", "hal/files", "proto"],
    "clients/common": ["daemon/serve", "hal/base", "hal/files", "proto", "daemon/recon", "clients/cpp", "clients/geometry"],
    "clients/recording": ["hal/base", "hal/files", "proto", "clients/cpp"],
    "clients/calibrate/fit": ["hal/files", "daemon/recon", "daemon/calibration"],
    "clients/calibrate/fit/model": ["daemon/recon", "daemon/calibration", "clients/calibrate/fit"],
    "clients/calibrate/lens": ["daemon/recon"],
    # These two refuse a crop that the daemon would refuse, with its own check.
    "clients/calibrate/offline": ["hal/base", "hal/files", "daemon/recon", "daemon/calibration", "daemon/pipeline/reference", "clients/common", "clients/calibrate/fit", "clients/calibrate/fit/model", "clients/calibrate/lens"],
    "clients/calibrate/guided": ["hal/base", "hal/files", "proto", "daemon/recon", "daemon/calibration", "daemon/pipeline/reference", "clients/common", "clients/cpp", "clients/calibrate/fit", "clients/calibrate/offline"],
    # Reprocesses a recording's depth with the daemon's own code.
    "clients/calibrate/reprocess": ["hal", "hal/base", "hal/files", "hal/luma", "hal/mjpeg", "proto", "daemon/calibration", "daemon/pipeline/reference", "daemon/pipeline/depth", "clients/common", "clients/recording"],
    # Contacts of pictures and of recordings.
    "clients/calibrate/force": ["hal/base", "hal/files", "daemon/recon", "daemon/calibration", "clients/common", "clients/cpp", "clients/calibrate/offline", "clients/recording"],
    "clients/calibrate/objects": ["hal/base", "hal/files", "clients/calibrate/guided", "clients/calibrate/offline", "clients/recording", "clients/common", "clients/cpp", "clients/geometry", "clients/perceive/recognition"],
    "clients/calibrate": ["clients/common", "clients/calibrate/force", "clients/calibrate/guided", "clients/calibrate/objects", "clients/calibrate/offline", "clients/calibrate/reprocess"],
    # A client and a server: it serves the wire with the daemon's own code.
    "clients/perceive": ["hal/base", "proto", "daemon/recon", "daemon/serve", "clients/common", "clients/cpp", "clients/geometry", "clients/perceive/pose", "clients/perceive/recognition"],
    # The same for browsers.
    "clients/web/foxglove": ["hal/base", "proto", "daemon/serve", "clients/cpp", "clients/common", "clients/recording", "clients/web"],
    "clients/web": ["hal/base", "proto", "daemon/serve", "clients/common", "clients/cpp", "clients/web/foxglove"],
    # Converts frames and passes commands on.
    "clients/dds": ["hal/base", "hal/files", "daemon/serve", "daemon/recon", "proto", "clients/common", "clients/cpp", "clients/geometry", "clients/recording"],
    # Administers a daemon: neither a fit nor OpenCV.
    "clients/ctl": ["hal/base", "hal/files", "hal/v4l2", "proto", "clients/common", "clients/cpp", "clients/recording"],
}
# Only standard headers and Highway may be in angle brackets here.
STANDARD_ONLY = {"daemon/recon": re.compile(r"^(hwy/.*|[a-z_]+)$")}
# The daemon links OpenCV's core module and no other.
OPENCV_CORE = re.compile(r"^opencv2/core(\.hpp|/.*)$")
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.M)


def room_of(path):
    """The deepest folder of the map that contains `path` (relative to the top), or None."""
    parent = pathlib.PurePosixPath(path).parent
    while str(parent) != ".":
        if str(parent) in ROOMS:
            return str(parent)
        parent = parent.parent
    return None


def complaints(top):
    for folder in ("hal", "daemon", "proto", "clients"):
        for path in sorted((top / folder).rglob("*.[ch]pp")):
            name = path.relative_to(top).as_posix()
            room = room_of(name)
            if room is None:
                yield f"{name}: lies in no room of the folder map"
                continue
            for bracket, included in INCLUDE.findall(path.read_text()):
                if bracket == "<":
                    if included.startswith("opencv2/") and not OPENCV_CORE.match(included) \
                            and not room.startswith("clients/"):
                        yield f"{name}: includes <{included}>; only OpenCV's core module is linked"
                    if room in STANDARD_ONLY and not STANDARD_ONLY[room].match(included):
                        yield f"{name}: {room} may use the standard library and Highway only, not <{included}>"
                    continue
                other = room_of(included)
                if other and other != room and other not in ROOMS[room]:
                    yield f"{name}: {room} may not include \"{included}\" ({other})"


def main():
    top = pathlib.Path(sys.argv[1]).resolve()
    found = list(complaints(top))
    for line in found:
        print(line)
    print(f"{len(found)} includes against the arrows")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
