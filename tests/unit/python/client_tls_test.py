"""The blocking client with a daemon that it knows by its certificate."""
import tempfile
import unittest
from unittest import mock

import certificate
import dtact
from fake_daemon import FakeDaemon, frame


class Tls(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = cls.enterClassContext(tempfile.TemporaryDirectory())
        made = certificate.make(cls.folder)
        if made is None:
            raise unittest.SkipTest("there is no openssl to make a certificate with")
        cls.context, cls.fingerprint = made

    def test_pinned(self):
        with FakeDaemon(tls=self.context) as daemon, \
                mock.patch("dtact.transport.is_local", return_value=False):
            daemon.pushed = [frame(1)]
            colons = ":".join(self.fingerprint[i : i + 2] for i in range(0, 64, 2)).upper()
            for pin in (self.fingerprint, colons):
                with dtact.connect(daemon.address, fingerprint=pin, token="secret") as s:
                    self.assertEqual(next(s.frames()).sequence, 1)
            self.assertEqual(daemon.requests[0].hello.token, "secret")
            self.assertEqual(daemon.requests[-1].subscribe.depth, 2)

    def test_another_certificate_gets_nothing(self):
        with FakeDaemon(tls=self.context) as daemon:
            with self.assertRaisesRegex(dtact.IdentityError, self.fingerprint):
                dtact.connect(daemon.address, fingerprint="0" * 64, token="secret")
        self.assertEqual(daemon.requests, [])

    def test_an_authority(self):
        with FakeDaemon(tls=self.context) as daemon, tempfile.TemporaryDirectory() as other:
            dtact.connect(daemon.address, ca_file=f"{self.folder}/certificate.pem").close()
            certificate.make(other)
            with self.assertRaisesRegex(dtact.IdentityError, "vouches"):
                dtact.connect(daemon.address, ca_file=f"{other}/certificate.pem")
            with self.assertRaisesRegex(dtact.Error, "PEM"):
                dtact.connect(daemon.address, ca_file=f"{other}/nothing.pem")

    def test_one_side_only(self):
        with FakeDaemon() as daemon:
            with self.assertRaises(dtact.ConnectionError):
                dtact.connect(daemon.address, fingerprint="0" * 64, timeout=1)
        with FakeDaemon(tls=self.context) as daemon:
            with self.assertRaises(dtact.ConnectionError):
                dtact.connect(daemon.address, timeout=1)

    def test_what_is_no_fingerprint(self):
        for text in ("", "12", "g" * 64):
            self.assertRaises(ValueError, dtact.connect, fingerprint=text)


if __name__ == "__main__":
    unittest.main()
