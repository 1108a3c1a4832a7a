import unittest

from dtact.address import Address, parse


class Parse(unittest.TestCase):
    def test_what_users_write(self):
        for text, wanted in [
            ("gripper", Address("gripper", 7377)),
            ("gripper:7378", Address("gripper", 7378)),
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


if __name__ == "__main__":
    unittest.main()
