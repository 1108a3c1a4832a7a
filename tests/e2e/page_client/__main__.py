"""A client of dtactd written from proto/README.md and proto/dtact.proto alone, with nothing but
Python's standard library, protobuf and protoc: the proof that the page suffices.

    page_client HOST PORT

Something has to touch the sensor and let go of it every few seconds. One line a check; exits 1 at
the first that the daemon fails, saying what the page says, and 77 where protobuf is missing.
zstd's encodings are checked where the module zstandard is.
"""
import sys
import time

import answers
import handshake
import light
import maps
import stream
from connection import Connection
from depth import check_golden
from outcome import Failed, demand, passed


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    address = (sys.argv[1], int(sys.argv[2]))
    Connection.open = lambda: Connection(address)
    try:
        check_golden()
        late = Connection(address, hello=False)
        began = time.monotonic()
        handshake.check_first_message(address)
        with Connection(address, hello=False) as c:
            handshake.check_hello(c)
            answers.check_requests(c)
            status = answers.check_status(c)
            message = late.receive(max(0, 8 - (time.monotonic() - began)))
            demand(message is None and not late.alive(),
                   "without a Hello within 5 s the connection ends, with no word", f"{message}")
            passed(f"no Hello: the end {time.monotonic() - began:.1f} s later")
            answers.check_reference(c, status)
            answers.check_reconstruction(c)
            maps.check_maps()
            maps.check_borders(c)
            stream.check_rates(c, status.camera.fps)
            stream.check_flow()
            stream.check_contact_events(c)
            light.check_light(c)
            light.check_rezero(c)
        handshake.check_after_hello(address)
    except Failed as failure:
        print("FAILED  the page says:", failure, flush=True)
        return 1
    print("all that the page says and a client sees is so")
    return 0


if __name__ == "__main__":
    sys.exit(main())
