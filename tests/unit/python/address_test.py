import unittest

from dtact.address import Address, parse


class Parse(unittest.TestCase):
    def test_what_users_write(self):
        for text, wanted in [
            ("gripper", Address("gripper", 7377)),
            ("gripper:7378", Address("gripper", 7378)),
            ("prüfstand.local.:7378", Address("prüfstand.local.", 7378)),
            ("192.168.1.5", Address("192.168.1.5", 7377)),
            ("192.168.1.5:1", Address("192.168.1.5", 1)),
            ("::1", Address("::1", 7377)),
            ("[::1]", Address("::1", 7377)),
            ("[fe80::1%eth0]:65535", Address("fe80::1%eth0", 65535)),
            ("unix:/run/dtactd/dtactd.sock", Address("", 0, "/run/dtactd/dtactd.sock")),
        ]:
            self.assertEqual(parse(text), wanted, text)

    def test_what_is_no_address(self):
        for text in ["", ":7377", "gripper:", "gripper:0", "gripper:65536", "gripper:x", "gripper:²",
                     "unix:", "[::1", "[::1]7377", "[]:1"]:
            self.assertRaises(ValueError, parse, text)

    def test_a_name_that_no_host_can_have_is_named(self):
        long = "g" * 64
        for text, named in [("gripper..local", "gripper..local"), (".local:7378", ".local"),
                            (long, long), (f"{long}.local:1", f"{long}.local")]:
            with self.assertRaises(ValueError) as caught:
                parse(text)
            self.assertEqual(str(caught.exception), f'"{named}" is no name of a host: each part between '
                             "dots has 1 to 63 characters")
        self.assertEqual(parse(f"unix:/{long}..x").path, f"/{long}..x")


if __name__ == "__main__":
    unittest.main()
