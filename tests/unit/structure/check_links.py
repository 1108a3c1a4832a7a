#!/usr/bin/env python3
"""Checks what the programs link: check_links.py DTACTD DTACTCTL DTACT_CALIBRATE DTACT_PERCEIVE DTACT_WEB DTACT_DDS

The libraries named by the program itself count (DT_NEEDED), not what those bring along.
"""
import re
import subprocess
import sys

FITS = ["dtact::calibration::fit_chain", "dtact::calibration::find_contact",
        "dtact::calibration::build"]
# Program: the modules of OpenCV that it may link, further libraries that it must not, and functions
# of the project that it must not contain.
RULES = {
    "dtactd": (["core"], [], FITS),
    # OpenSSL it may: it speaks TLS to the daemon and makes certificates. libsystemd it may: it asks Avahi over
    # D-Bus. Highway it may: it writes point clouds.
    "dtactctl": ([], ["gpiod", "camera", "spdlog"],
                 FITS + ["dtact::calibration::load", "dtact::recon::Reconstructor::run"]),
    "dtact-calibrate": (["core", "imgproc", "calib3d", "dnn"],
                        ["systemd", "gpiod", "camera", "spdlog"], []),
    # It receives depth; the recognition runs a network.
    "dtact-perceive": (["core", "dnn"], ["tomlplusplus", "systemd", "gpiod", "camera", "spdlog"],
                       FITS + ["dtact::calibration::load", "dtact::recon::Reconstructor::run"]),
    # It only forwards, and asks Avahi over D-Bus.
    "dtact-web": ([], ["tomlplusplus", "gpiod", "camera", "spdlog"],
                  FITS + ["dtact::calibration::load", "dtact::recon::Reconstructor::run"]),
    # It receives depth, and asks Avahi over D-Bus.
    "dtact-dds": ([], ["tomlplusplus", "gpiod", "camera", "spdlog"],
                  FITS + ["dtact::calibration::load", "dtact::recon::Reconstructor::run"]),
}


def contains(symbols, function):
    return re.search(rf" [Tt] {re.escape(function)}\(", symbols)


def complaints(name, libraries, symbols):
    modules, libraries_not, functions_not = RULES[name]
    for library in libraries:
        stem = re.sub(r"^lib|\.so.*$", "", library)
        if stem.startswith("opencv_") and stem.removeprefix("opencv_") not in modules:
            yield f"{name} links {library}; of OpenCV it may link: {', '.join(modules) or 'nothing'}"
        if stem in libraries_not:
            yield f"{name} must not link {library}"
    for function in functions_not:
        if contains(symbols, function):
            yield f"{name} must not contain {function}()"


def output(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def main():
    found = []
    # A name that no longer exists would forbid nothing.
    calibrate = output("nm", "-C", sys.argv[3])
    found += [f"{name} is not in dtact-calibrate: name another here"
              for name in sorted({f for rule in RULES.values() for f in rule[2]})
              if not contains(calibrate, name)]
    for name, program in zip(RULES, sys.argv[1:], strict=True):
        libraries = re.findall(r"\(NEEDED\).*\[(.*)\]", output("readelf", "-dW", program))
        if not libraries:
            found.append(f"{program} names no libraries: readelf printed nothing")
        found += complaints(name, libraries, output("nm", "-C", program))
    print("\n".join(found + [f"{len(found)} links that must not be"]))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
