"""The messages of proto/dtact.proto, by protobuf and protoc: M their classes, E their enums'
values."""
import pathlib
import subprocess
import sys
import tempfile
import types

try:
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
except ImportError:
    print("skipped: apt-get install python3-protobuf")
    sys.exit(77)

SOURCE = pathlib.Path(__file__).resolve().parents[3]


def load_messages():
    """The classes of dtact.proto's messages by name, and its enums' values."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder, "dtact.pb")
        try:
            subprocess.run(["protoc", "-I", SOURCE / "proto", f"--descriptor_set_out={out}",
                            "dtact.proto"], check=True)
        except FileNotFoundError:
            print("skipped: apt-get install protobuf-compiler")
            sys.exit(77)
        files = descriptor_pb2.FileDescriptorSet.FromString(out.read_bytes())
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.AddSerializedFile(file.SerializeToString())
    make = getattr(message_factory, "GetMessageClass", None)
    if make is None:
        make = message_factory.MessageFactory(pool).GetPrototype
    classes, values = {}, {}
    for file in files.file:
        for message in file.message_type:
            name = f"{file.package}.{message.name}"
            classes[message.name] = make(pool.FindMessageTypeByName(name))
        for enum in file.enum_type:
            values.update({value.name: value.number for value in enum.value})
            values[enum.name] = {value.number: value.name for value in enum.value}
    return types.SimpleNamespace(**classes), types.SimpleNamespace(**values)


M, E = load_messages()
