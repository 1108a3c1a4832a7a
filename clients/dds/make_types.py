#!/usr/bin/env python3
"""Makes what the program needs to know about its ROS 2 messages, from ros2.msg and dtact_msgs/msg.

  make_types.py hashes          each message and its type hash (RIHS01, REP-2016), for people and tests
  make_types.py idl FILE        the messages as OMG IDL, with the names that ROS 2 gives them on DDS
  make_types.py header FILE     a C++ table of type names, hashes and definitions
"""
import hashlib
import json
import pathlib
import re
import sys

HERE = pathlib.Path(__file__).parent
# Name in .msg: type_description_interfaces/FieldType, and name in IDL.
PRIMITIVES = {
    "int8": (2, "int8"), "uint8": (3, "uint8"), "int16": (4, "short"), "uint16": (5, "unsigned short"),
    "int32": (6, "long"), "uint32": (7, "unsigned long"), "int64": (8, "long long"), "uint64": (9, "unsigned long long"),
    "float32": (10, "float"), "float64": (11, "double"), "char": (3, "uint8"), "bool": (15, "boolean"),
    "byte": (16, "octet"), "string": (17, "string"),
}
BOUNDED_STRING, ARRAY, BOUNDED_SEQUENCE, SEQUENCE = 21, 48, 96, 144
FIELD = re.compile(r"(?P<base>[\w/]+?)(?:<=(?P<chars>\d+))?(?:\[(?P<bound><=)?(?P<size>\d*)\])?\s+(?P<name>[a-z]\w*)\b(?!\s*=)")


def read(text, package, name, messages):
    """Adds the message to `messages`: its definition and its fields (name, base, characters, array, size)."""
    fields = []
    for line in text.splitlines():
        found = FIELD.match(line)
        if not found:
            continue
        base = found["base"]
        if base not in PRIMITIVES and "/" not in base:
            base = f"{package}/{base}"
        array = None if found["size"] is None else (
            SEQUENCE if not found["size"] else BOUNDED_SEQUENCE if found["bound"] else ARRAY)
        fields.append((found["name"], base, int(found["chars"] or 0), array, int(found["size"] or 0)))
    messages[f"{package}/{name}"] = (text.strip() + "\n", fields)


def read_all():
    """All messages, each after those that it consists of."""
    messages = {}
    for part in re.split(r"^MSG: ", (HERE / "ros2.msg").read_text(), flags=re.M)[1:]:
        title, _, text = part.partition("\n")
        read(text, *title.split("/"), messages)
    for path in sorted((HERE / "dtact_msgs/msg").glob("*.msg")):
        read(path.read_text(), "dtact_msgs", path.stem, messages)
    return messages


def parts_of(name, messages):
    """Names of the messages that a message consists of, directly or not, sorted."""
    found = set()
    for _, base, *_ in messages[name][1]:
        if base in messages:
            found |= {base, *parts_of(base, messages)}
    return sorted(found)


def type_hash(name, messages):
    def described(one):
        package, message = one.split("/")
        return {"type_name": f"{package}/msg/{message}", "fields": [
            {"name": field, "type": {
                "type_id": (1 if base in messages else BOUNDED_STRING if chars else PRIMITIVES[base][0]) + (array or 0),
                "capacity": size, "string_capacity": chars,
                "nested_type_name": base.replace("/", "/msg/") if base in messages else ""}}
            for field, base, chars, array, size in messages[one][1]]}

    text = json.dumps({"type_description": described(name),
                       "referenced_type_descriptions": [described(part) for part in parts_of(name, messages)]})
    return "RIHS01_" + hashlib.sha256(text.encode()).hexdigest()


def dds_name(name):
    package, message = name.split("/")
    return f"{package}::msg::dds_::{message}_"


def idl(messages):
    lines = ["// Made by make_types.py."]
    for name, (_, fields) in messages.items():
        package, message = name.split("/")
        lines.append(f"module {package} {{ module msg {{ module dds_ {{ @final struct {message}_ {{")
        for field, base, chars, array, size in fields:
            kind = dds_name(base) if base in messages else PRIMITIVES[base][1] + (f"<{chars}>" if chars else "")
            if array in (SEQUENCE, BOUNDED_SEQUENCE):
                kind = f"sequence<{kind}{f', {size}' if size else ''}>"
            lines.append(f"  {kind} {field}{f'[{size}]' if array == ARRAY else ''};")
        lines.append("}; }; }; };")
    return "\n".join(lines) + "\n"


def definition(name, messages):
    """The definition with those of its parts, as rosbag2 and MCAP store it (schema encoding ros2msg)."""
    rule = "=" * 80
    return messages[name][0] + "".join(f"{rule}\nMSG: {part}\n{messages[part][0]}" for part in parts_of(name, messages))


def header(messages):
    rows = "\n".join(f'    {{"{dds_name(name)}",\n     "{type_hash(name, messages)}",\n'
                     f'     R"msg({definition(name, messages)})msg"}},' for name in messages)
    return f"""// Made by make_types.py.
#pragma once
#include <array>
namespace dtact::dds {{
struct Type {{
  const char* name;        ///< On DDS.
  const char* hash;        ///< RIHS01.
  const char* definition;  ///< Schema encoding ros2msg.
}};
inline constexpr std::array<Type, {len(messages)}> kTypes{{{{
{rows}
}}}};
}}  // namespace dtact::dds
"""


def main():
    messages = read_all()
    if sys.argv[1:] == ["hashes"]:
        for name in messages:
            print(name, type_hash(name, messages))
    elif len(sys.argv) == 3 and sys.argv[1] in ("idl", "header"):
        pathlib.Path(sys.argv[2]).write_text({"idl": idl, "header": header}[sys.argv[1]](messages))
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
