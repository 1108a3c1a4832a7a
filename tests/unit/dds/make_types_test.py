#!/usr/bin/env python3
"""make_types_test.py: type hashes against those that ROS 2's own generator publishes, and the IDL."""
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "clients/dds"))
import make_types  # noqa: E402

# From the generated sources and recordings of ROS 2 Iron to Kilted.
PUBLISHED = {
    "builtin_interfaces/Time": "b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197",
    "std_msgs/Header": "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01",
    "std_msgs/ColorRGBA": "77a7a5b9ae477306097665106e0413ba74440245b1f3d0c6d6405fe5c7813fe8",
    "geometry_msgs/Quaternion": "8a765f66778c8ff7c8ab94afcc590a2ed5325a1d9a076ffff38fbce36f458684",
    "geometry_msgs/PoseStamped": "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    "geometry_msgs/WrenchStamped": "8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77",
    "tf2_msgs/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "sensor_msgs/CameraInfo": "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
    "sensor_msgs/CompressedImage": "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
    "sensor_msgs/Image": "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
    "sensor_msgs/PointCloud2": "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    "sensor_msgs/Temperature": "72514a14126ab9f8a9abec974c78e5610a367b59db5da355ff1fb982d5bad4b8",
    "diagnostic_msgs/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "rmw_dds_common/ParticipantEntitiesInfo": "91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e",
}


class MakeTypes(unittest.TestCase):
    def test_hashes_are_the_published_ones(self) -> None:
        messages = make_types.read_all()
        for name, published in PUBLISHED.items():
            self.assertEqual(make_types.type_hash(name, messages), "RIHS01_" + published, name)

    def test_every_kind_of_field(self) -> None:
        messages = {}
        make_types.read("# A comment.\nint32 LEFT=3\nstring<=5[<=7] names  # bounded twice\nbyte[4] raw\nint8 x 5\n"
                        "Other[] others\n", "p", "One", messages)
        make_types.read("bool on\n", "p", "Other", messages)
        self.assertEqual(messages["p/One"][1], [
            ("names", "string", 5, make_types.BOUNDED_SEQUENCE, 7), ("raw", "byte", 0, make_types.ARRAY, 4),
            ("x", "int8", 0, None, 0), ("others", "p/Other", 0, make_types.SEQUENCE, 0)])
        for line in ("sequence<string<5>, 7> names;", "octet raw[4];", "sequence<p::msg::dds_::Other_> others;"):
            self.assertIn(line, make_types.idl(messages))
        self.assertEqual(make_types.definition("p/One", messages).split("=" * 80)[1], "\nMSG: p/Other\nbool on\n")


if __name__ == "__main__":
    unittest.main()
