"""The messages of proto/dtact.proto, made when the package is imported.

Code that protoc generates works only with the protobuf releases near its own. The schema itself
works with all: dtact.binpb is `protoc --descriptor_set_out` of proto/dtact.proto. After a change
of the schema, in clients/python:

    protoc -I ../../proto --descriptor_set_out=src/dtact/dtact.binpb ../../proto/dtact.proto
"""
from __future__ import annotations

from importlib import resources
from typing import Any, cast

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

# A message has the fields of its type in dtact.proto as attributes.
Message = Any

# A pool of its own: another package may have messages of the same names in protobuf's default one.
_pool = descriptor_pool.DescriptorPool()
for _file in descriptor_pb2.FileDescriptorSet.FromString(
    resources.files(__package__).joinpath("dtact.binpb").read_bytes()
).file:
    _pool.AddSerializedFile(_file.SerializeToString())

# The fields of foxglove.CompressedImage that the reader needs; protobuf skips the others.
_pool.AddSerializedFile(
    descriptor_pb2.FileDescriptorProto(
        name="compressed_image.proto",
        package="foxglove",
        syntax="proto3",
        message_type=[
            descriptor_pb2.DescriptorProto(
                name="CompressedImage",
                field=[
                    descriptor_pb2.FieldDescriptorProto(
                        name="data",
                        number=2,
                        type=descriptor_pb2.FieldDescriptorProto.TYPE_BYTES,
                        label=descriptor_pb2.FieldDescriptorProto.LABEL_OPTIONAL,
                    )
                ],
            )
        ],
    ).SerializeToString()
)

# protobuf 4.22 brought GetMessageClass, 5 took GetPrototype away.
if hasattr(message_factory, "GetMessageClass"):
    _class_of = message_factory.GetMessageClass
else:
    _class_of = message_factory.MessageFactory(_pool).GetPrototype


def message_class(name: str) -> Any:
    """The class of the messages of type dtact.v1.`name`."""
    return _class_of(_pool.FindMessageTypeByName(f"dtact.v1.{name}"))


COMPRESSED_IMAGE = _class_of(_pool.FindMessageTypeByName("foxglove.CompressedImage"))
ClientMessage = message_class("ClientMessage")
ServerMessage = message_class("ServerMessage")


def name_of(enum: str, value: int, prefix: str | None = None) -> str:
    """("Health", 3) → "light_unsettled"; a value of a newer daemon → "103"."""
    found = _pool.FindEnumTypeByName(f"dtact.v1.{enum}").values_by_number.get(value)
    if found is None:
        return str(value)
    return cast(str, found.name).removeprefix(prefix or f"{enum.upper()}_").lower()


def value_of(constant: str) -> int:
    """ "DEPTH_INT16" → 1. KeyError for a name that the schema does not have."""
    file = _pool.FindFileContainingSymbol("dtact.v1.ClientMessage")
    for enum in file.enum_types_by_name.values():
        if constant in enum.values_by_name:
            return cast(int, enum.values_by_name[constant].number)
    raise KeyError(constant)
