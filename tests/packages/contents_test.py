#!/usr/bin/env python3
"""What the Debian packages in the folder given hold: contents_test.py FOLDER.

Exit code: 0 passed; 77 there are no packages; else failed.
"""
import json
import pathlib
import re
import subprocess
import sys
import unittest

TREE = pathlib.Path(__file__).resolve().parents[2]
FOLDER = pathlib.Path(sys.argv.pop(1))

# Patterns of a list that is the same on Debian 12 and 13, amd64 and arm64: LIB is the architecture's folder,
# UNITS where this Debian has its units, and an asterisk any name.
FILES = {
    "dtactd": """
        /etc/dtactd/dtactd.toml
        /usr/bin/dtactd
        UNITS/dtactd.service
        UNITS/dtactd@.service
        /usr/lib/sysusers.d/dtactd.conf
        /usr/lib/tmpfiles.d/dtactd.conf
        /usr/lib/udev/rules.d/60-dtactd.rules
        /usr/share/doc/dtactd/examples/boards/raspberry-pi-5-usb-pio.toml
        /usr/share/doc/dtactd/examples/boards/try-board.sh
        /usr/share/doc/dtactd/examples/devices.conf
        /usr/share/doc/dtactd/examples/grafana/dtactd.json
        /usr/share/doc/dtactd/examples/network.conf
        /usr/share/dtactd/scenes/calibration_presses.toml
        /usr/share/dtactd/scenes/default.toml
        /usr/share/dtactd/simulated/calibration.toml
        /usr/share/dtactd/simulated/reference.png
        /usr/share/man/man5/dtactd.toml.5.gz
        /usr/share/man/man8/dtactd.8.gz
        /usr/share/bash-completion/completions/dtactd
        /usr/share/zsh/vendor-completions/_dtactd""",
    "dtact-tools": """
        /usr/bin/dtact-calibrate
        /usr/bin/dtact-perceive
        /usr/bin/dtact-web
        /usr/bin/dtactctl
        UNITS/dtact-perceive.service
        UNITS/dtact-web.service
        /usr/share/bash-completion/completions/dtact-calibrate
        /usr/share/bash-completion/completions/dtactctl
        /usr/share/bash-completion/completions/dtact-perceive
        /usr/share/bash-completion/completions/dtact-web
        /usr/share/man/man1/dtact-calibrate.1.gz
        /usr/share/man/man1/dtact-perceive.1.gz
        /usr/share/man/man1/dtact-web.1.gz
        /usr/share/man/man1/dtactctl.1.gz
        /usr/share/zsh/vendor-completions/_dtact-calibrate
        /usr/share/zsh/vendor-completions/_dtact-perceive
        /usr/share/zsh/vendor-completions/_dtact-web
        /usr/share/zsh/vendor-completions/_dtactctl
        /usr/share/dtact/foxglove-layout.json
        /usr/share/dtact/foxglove/dtact-live.json
        /usr/share/dtact/foxglove/dtact-points.json""",
    "dtact-dds": """
        /usr/bin/dtact-dds
        UNITS/dtact-dds.service
        /usr/share/bash-completion/completions/dtact-dds
        /usr/share/dtact_msgs/CMakeLists.txt
        /usr/share/dtact_msgs/msg/Contact.msg
        /usr/share/dtact_msgs/package.xml
        /usr/share/man/man1/dtact-dds.1.gz
        /usr/share/zsh/vendor-completions/_dtact-dds""",
    "libdtact1": """
        LIB/libdtact.so.1""",
    "libdtact-dev": """
        /usr/include/dtact/client.hpp
        /usr/include/dtact/dtact.pb.h
        LIB/cmake/dtact/dtactConfig.cmake
        LIB/cmake/dtact/dtactConfigVersion.cmake
        LIB/cmake/dtact/dtactTargets.cmake
        LIB/libdtact.so
        LIB/pkgconfig/dtact.pc
        /usr/share/dtact/proto/README.md
        /usr/share/dtact/proto/dtact.proto""",
    "python3-dtact": """
        /usr/lib/python3/dist-packages/dtact/__init__.py
        /usr/lib/python3/dist-packages/dtact/dtact.binpb
        /usr/lib/python3/dist-packages/dtact/py.typed""",
}
# systemd 252, Debian 12's, does not know these keys.
BACK_OFF = """
        UNITS/dtactd.service.d/back-off.conf
        UNITS/dtactd@.service.d/back-off.conf"""
# The folders and names that a package may have files in.
PLACES = {
    "dtactd": r"/etc/dtactd/|/usr/bin/dtactd$|(/usr)?/lib/systemd/system/dtactd|/usr/lib/\w+\.d/dtactd|"
    r"/usr/lib/udev/rules\.d/60-dtactd|/usr/share/dtactd/(scenes|simulated)/|/usr/share/man/man[58]/dtactd|"
    r"/usr/share/(bash|zsh)",
    "dtact-tools": r"/usr/bin/dtact(ctl|-calibrate|-perceive|-web)$|/usr/share/(bash|zsh)|/usr/share/dtact/foxglove|"
    r"(/usr)?/lib/systemd/system/dtact-(perceive|web)\.service$|/usr/share/man/man1/dtact",
    "dtact-dds": r"/usr/bin/dtact-dds$|/usr/share/(bash|zsh|dtact_msgs)|(/usr)?/lib/systemd/system/dtact-dds\.service$|"
    r"/usr/share/man/man1/dtact-dds",
    "libdtact1": r"LIB/libdtact\.so\.1$",
    "libdtact-dev": r"/usr/include/dtact/|LIB/(cmake/dtact/|libdtact\.so$|pkgconfig/dtact\.pc$)|"
    r"/usr/share/dtact/proto/",
    "python3-dtact": r"/usr/lib/python3/dist-packages/dtact(/|-[\d.]+\.egg-info/)",
}


def output(*command: str | pathlib.Path) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def package(name: str) -> pathlib.Path:
    (found,) = FOLDER.glob(f"{name}_*.deb")
    return found


def field(name: str, key: str) -> str:
    return output("dpkg-deb", "--field", package(name), key).strip()


def files(name: str) -> dict[str, str]:
    """Path → rights and owner, of everything but folders."""
    listing = [line.split() for line in output("dpkg-deb", "--contents", package(name)).splitlines()]
    return {words[5].removeprefix("."): f"{words[0]} {words[1]}" for words in listing if words[0][0] != "d"}


def control(name: str, member: str) -> str:
    """A file of the package's control archive, '' where there is none."""
    return subprocess.run(["dpkg-deb", "--info", package(name), member], capture_output=True, text=True).stdout


def content(name: str, path: str) -> str:
    """A file's text."""
    tree = subprocess.run(["dpkg-deb", "--fsys-tarfile", package(name)], check=True, capture_output=True).stdout
    return subprocess.run(["tar", "-xO", f".{path}"], check=True, capture_output=True, input=tree).stdout.decode()


def triplet() -> str:
    return {"amd64": "x86_64-linux-gnu", "arm64": "aarch64-linux-gnu"}[field("dtactd", "Architecture")]


class Contents(unittest.TestCase):
    def test_the_packages_are_these(self) -> None:
        names = sorted(path.name.split("_")[0] for path in FOLDER.glob("*.deb") if "-dbgsym_" not in path.name)
        self.assertEqual(names, ["dtact-dds", "dtact-tools", "dtactd", "libdtact-dev", "libdtact1", "python3-dtact"])

    def test_each_holds_its_files_and_no_others(self) -> None:
        for name, expected in FILES.items():
            present = files(name)
            units = "/lib/systemd/system" if any(path.startswith("/lib/") for path in present) else "/usr/lib/systemd/system"
            backs_off = name == "dtactd" and units.startswith("/usr/")
            self.assertEqual(any("back-off" in path for path in present), backs_off)
            expected += BACK_OFF if backs_off else ""
            for path in expected.split():
                path = path.replace("LIB", f"/usr/lib/{triplet()}").replace("UNITS", units)
                self.assertIn(path, present)
            places = PLACES[name].replace("LIB", f"/usr/lib/{triplet()}") + f"|/usr/share/doc/{name}/"
            for path, rights in present.items():
                self.assertRegex(path, f"^({places})", name)
                self.assertRegex(rights, "^(-rw-r--r--|-rwxr-xr-x|lrwxrwxrwx) root/root$", path)

    def test_pages_of_one_name_are_both_there(self) -> None:
        pages = {path.removesuffix(".gz") for path in files("dtact-tools")}
        for name in ("calibrate", "recording"):
            self.assertIn(f"/usr/share/doc/dtact-tools/{name}.md", pages)

    def test_the_configuration_is_the_only_conffile(self) -> None:
        self.assertEqual(control("dtactd", "conffiles"), "/etc/dtactd/dtactd.toml\n")
        for name in FILES.keys() - {"dtactd"}:
            self.assertEqual(control(name, "conffiles"), "", name)

    def test_debhelper_wrote_what_installs_the_service(self) -> None:
        postinst = control("dtactd", "postinst")
        for snippet in (
            "systemd-sysusers ${DPKG_ROOT:+--root=\"$DPKG_ROOT\"} dtactd.conf",
            "--create dtactd.conf",
            "deb-systemd-helper enable 'dtactd.service'",
            "deb-systemd-invoke $_dh_action 'dtactd.service'",
        ):
            self.assertIn(snippet, postinst)
        # The user is made before its folders, its groups before the devices are given to
        # them, and all before the start.
        for steps in (("udevadm trigger", "udevadm settle"), ("--create",)):
            order = [postinst.index(word) for word in ("systemd-sysusers", *steps, "deb-systemd-invoke")]
            self.assertEqual(order, sorted(order))
        self.assertIn("deb-systemd-invoke stop 'dtactd.service'", control("dtactd", "prerm"))
        self.assertIn("deb-systemd-helper purge 'dtactd.service'", control("dtactd", "postrm"))
        for script in ("postinst", "prerm", "postrm"):
            self.assertNotIn("#DEBHELPER#", control("dtactd", script))
            # No instance of the template starts or is enabled automatically.
            self.assertNotRegex(control("dtactd", script), r"(invoke start|enable) 'dtactd@")

    def test_what_stands_beside_the_daemon_waits_to_be_wanted(self) -> None:
        postinst = control("dtact-tools", "postinst")
        both = r"'?dtact-perceive\.service'? '?dtact-web\.service'?"
        # It is not started, but an upgrade restarts a running one, and a removal stops it.
        self.assertRegex(postinst, f"deb-systemd-invoke try-restart {both}")
        self.assertNotRegex(postinst, "deb-systemd-invoke (?!try-restart )")
        self.assertRegex(control("dtact-tools", "prerm"), f"deb-systemd-invoke stop {both}")
        self.assertRegex(control("dtact-dds", "prerm"), "deb-systemd-invoke stop '?dtact-dds.service")
        for unit in ("dtact-perceive.service", "dtact-web.service"):
            # It is enabled again where it had been enabled, and nowhere else.
            self.assertIn(f"deb-systemd-helper debian-installed '{unit}'", postinst)
            self.assertRegex(control("dtact-tools", "postrm"), f"deb-systemd-helper purge .*'{unit}'")

    def test_each_depends_on_what_it_needs_and_no_more(self) -> None:
        version = field("libdtact1", "Version")
        self.assertIn(f"libdtact1 (= {version}), libprotobuf-dev", field("libdtact-dev", "Depends"))
        python = field("python3-dtact", "Depends")
        for needed in ("python3-numpy", "python3-protobuf", "python3-zstandard"):
            self.assertIn(needed, python)
        # Nothing is compiled: one package for every machine and every Python from 3.11 on.
        self.assertNotRegex(python, r"python3 \(<<")
        self.assertEqual(field("python3-dtact", "Architecture"), "all")
        self.assertIn("opencv-calib3d", field("dtact-tools", "Depends"))
        self.assertNotRegex(field("dtactd", "Depends"), "opencv-(calib3d|imgproc)")
        self.assertNotRegex(field("dtact-tools", "Depends"), "libcamera|libgpiod|libdtact1")
        self.assertEqual(control("libdtact1", "shlibs"), "libdtact 1 libdtact1 (>= 0.1.0)\n")
        # Debian 12's libcamera only suggests it, and finds no CSI camera without.
        self.assertIn("libcamera-ipa", field("dtactd", "Recommends"))
        for name in ("libdtact1", "libdtact-dev"):
            self.assertEqual(field(name, "Multi-Arch"), "same")

    def test_the_copyright_names_all_that_is_bundled(self) -> None:
        paragraphs = content("dtact-tools", "/usr/share/doc/dtact-tools/copyright").split("\n\n")
        licences = {}  # a folder of files → the names of its licences
        texts = set()
        for paragraph in paragraphs:
            licence = re.search(r"^License: (.*)", paragraph, re.MULTILINE)
            holders = re.search(r"^Copyright: \S", paragraph, re.MULTILINE)
            folders = re.search(r"^Files: (.*(?:\n .*)*)", paragraph, re.MULTILINE)
            if licence and holders and folders:
                licences.update(dict.fromkeys(folders[1].split(), licence[1].split(" and ")))
            elif licence:
                texts.add(licence[1])
        lock = json.loads((TREE / "clients/web/page/package-lock.json").read_text())
        bundled = {name: about["license"] for name, about in lock["packages"].items() if name and not about.get("dev")}
        self.assertIn("node_modules/three", bundled)
        for name, licence in bundled.items():
            self.assertIn(f"{name}/*", licences)
            # Debian's names of licences; ones of a kind that differ in their words are distinguished at the end.
            wanted = licence.strip("()").replace("MIT", "Expat").split(" AND ")
            for one, found in zip(wanted, licences[f"{name}/*"], strict=True):
                self.assertRegex(found, f"(?i)^{one}(-|$)", name)
                self.assertIn(found, texts)

    def test_the_tree_says_the_same_elsewhere(self) -> None:
        project = re.search(r"project\(dtactd VERSION ([\d.]+)", (TREE / "CMakeLists.txt").read_text())
        assert project
        for name in FILES:
            self.assertRegex(field(name, "Version"), f"^{re.escape(project[1])}-", "debian/changelog")
        self.assertIn(
            f"/usr/lib/python3/dist-packages/dtact-{project[1]}.egg-info/PKG-INFO", files("python3-dtact"), "pyproject.toml"
        )
        # What ./dev installs and what the packages are built with.
        listed = re.search(r"build_packages=\((.*?)\)", (TREE / "dev").read_text(), re.DOTALL)
        assert listed
        needed = re.search(r"Build-Depends: (.*?)\n\n", (TREE / "debian/control").read_text(), re.DOTALL)
        assert needed
        build_depends = {word.split()[0].split(":")[0] for word in needed[1].split(",")}
        self.assertEqual(set(listed[1].split()) - build_depends, {"g++", "ccache"})
        self.assertEqual(
            {word for word in build_depends - set(listed[1].split()) if "python" not in word},
            {"debhelper-compat", "dh-sequence-installsysusers"},
        )


if __name__ == "__main__":
    if not list(FOLDER.glob("*.deb")):
        print(f"skipped: no packages in {FOLDER}", file=sys.stderr)
        sys.exit(77)
    unittest.main(verbosity=2)
