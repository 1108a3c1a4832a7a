"""A certificate for a test, signed by itself."""
import hashlib
import shutil
import ssl
import subprocess


def make(folder):
    """The server's TLS context and the fingerprint of certificate.pem, which is written into `folder`;
    None where there is no openssl to make one."""
    if shutil.which("openssl") is None:
        return None
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes",
         "-subj", "/CN=dtactd", "-addext", "subjectAltName=IP:127.0.0.1", "-days", "2",
         "-keyout", f"{folder}/key.pem", "-out", f"{folder}/certificate.pem"],
        check=True, capture_output=True)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(f"{folder}/certificate.pem", f"{folder}/key.pem")
    with open(f"{folder}/certificate.pem", encoding="ascii") as f:
        der = ssl.PEM_cert_to_DER_cert(f.read())
    return context, hashlib.sha256(der).hexdigest()
