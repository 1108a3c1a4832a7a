// The messages only grow: everything in tests/golden/dtact.binpb exists under the same numbers
// and names, so that programs of that schema and of today's understand each other.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.pb.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "proto/dtact.pb.h"

namespace dtact::v1 {
namespace {

using google::protobuf::DescriptorProto;
using google::protobuf::EnumDescriptorProto;
using google::protobuf::FieldDescriptorProto;
using google::protobuf::FileDescriptorProto;
using testing::IsEmpty;

using Lines = std::vector<std::string>;

std::string oneof_of(const DescriptorProto& message, const FieldDescriptorProto& field) {
  return field.has_oneof_index() ? message.oneof_decl(field.oneof_index()).name() : "";
}

/// One line for each message, field, and enum value: everything that a peer depends on.
void add_lines(const std::string& scope, const EnumDescriptorProto& one, Lines& lines) {
  for (const auto& value : one.value()) {
    lines.push_back(scope + one.name() + "." + value.name() + " = " +
                    std::to_string(value.number()));
  }
}

void add_lines(const std::string& scope, const DescriptorProto& message, Lines& lines) {
  const std::string name = scope + message.name();
  lines.push_back("message " + name);
  for (const auto& field : message.field()) {
    lines.push_back(name + "." + field.name() + " = " + std::to_string(field.number()) + ": " +
                    FieldDescriptorProto::Type_Name(field.type()) + " " + field.type_name() + " " +
                    FieldDescriptorProto::Label_Name(field.label()) + " " +
                    oneof_of(message, field));
  }
  for (const auto& nested : message.nested_type()) add_lines(name + ".", nested, lines);
  for (const auto& nested : message.enum_type()) add_lines(name + ".", nested, lines);
}

Lines lines_of(const FileDescriptorProto& file) {
  Lines lines;
  for (const auto& message : file.message_type()) add_lines("", message, lines);
  for (const auto& one : file.enum_type()) add_lines("", one, lines);
  return lines;
}

/// The lines of `before` that are missing or different in `now`.
Lines lost(const FileDescriptorProto& before, const FileDescriptorProto& now) {
  const Lines present = lines_of(now);
  Lines missing;
  for (const std::string& line : lines_of(before)) {
    if (std::ranges::find(present, line) == present.end()) missing.push_back(line);
  }
  return missing;
}

FileDescriptorProto present_schema() {
  FileDescriptorProto file;
  Hello::descriptor()->file()->CopyTo(&file);
  return file;
}

TEST(Schema, OnlyGrows) {
  google::protobuf::FileDescriptorSet committed;
  std::ifstream file(DTACT_SOURCE_DIR "/tests/golden/dtact.binpb", std::ios::binary);
  ASSERT_TRUE(committed.ParseFromIstream(&file));
  ASSERT_EQ(committed.file_size(), 1);
  EXPECT_THAT(lost(committed.file(0), present_schema()), IsEmpty())
      << "After a release these stay as they are. Before one, and with every release: protoc -I "
         "proto --descriptor_set_out=tests/golden/dtact.binpb proto/dtact.proto";
}

TEST(Schema, MayGrow) {
  FileDescriptorProto now = present_schema();
  auto& message = *now.mutable_message_type(0);
  message.add_oneof_decl()->set_name("another");
  auto& field = *message.add_field();
  field.set_name("another_field");
  field.set_number(999);
  field.set_type(FieldDescriptorProto::TYPE_BOOL);
  now.mutable_enum_type(0)->add_value()->set_number(999);
  now.add_message_type()->set_name("Another");
  EXPECT_THAT(lost(present_schema(), now), IsEmpty());
}

/// The field `name` of ClientMessage.
FieldDescriptorProto& field_of(FileDescriptorProto& file, std::string_view name) {
  for (auto& field : *file.mutable_message_type(0)->mutable_field()) {
    if (field.name() == name) return field;
  }
  throw std::invalid_argument("ClientMessage has no such field");
}

TEST(Schema, LosesNothingUnnoticed) {
  const std::vector<std::function<void(FileDescriptorProto&)>> changes = {
      [](auto& file) { field_of(file, "ping").set_number(999); },
      [](auto& file) { field_of(file, "ping").set_name("pong"); },
      [](auto& file) { field_of(file, "ping").set_type_name(".dtact.v1.Pong"); },
      [](auto& file) { field_of(file, "ping").clear_oneof_index(); },
      [](auto& file) { field_of(file, "id").set_type(FieldDescriptorProto::TYPE_SINT64); },
      [](auto& file) { field_of(file, "id").set_label(FieldDescriptorProto::LABEL_REPEATED); },
      [](auto& file) { file.mutable_message_type(0)->mutable_field()->RemoveLast(); },
      [](auto& file) { file.mutable_enum_type(0)->mutable_value(1)->set_number(999); },
      [](auto& file) { file.mutable_enum_type(0)->mutable_value()->RemoveLast(); }};
  for (std::size_t i = 0; i < changes.size(); ++i) {
    FileDescriptorProto now = present_schema();
    changes[i](now);
    EXPECT_EQ(lost(present_schema(), now).size(), 1U) << i;
  }
  FileDescriptorProto now = present_schema();
  const std::string last = now.message_type().rbegin()->name();
  now.mutable_message_type()->RemoveLast();
  EXPECT_THAT(lost(present_schema(), now), testing::Contains("message " + last));
}

// The example of proto/README.md.
TEST(Schema, HelloHasThePagesBytes) {
  ClientMessage message;
  message.set_id(1);
  message.mutable_hello()->set_major(1);
  message.mutable_hello()->set_minor(1);
  message.mutable_hello()->set_program("x");
  constexpr std::string_view kBytes = "\x08\x01\x12\x07\x08\x01\x10\x01\x1a\x01x";
  EXPECT_EQ(message.SerializeAsString(), kBytes);
}

}  // namespace
}  // namespace dtact::v1
