// mcap_sample write FILE: writes a file with everything that the writer can write.
// mcap_sample read FILE: prints what the reader finds, a line each.
#include <exception>
#include <iostream>
#include <set>
#include <string>

#include "hal/files/mcap_reader.hpp"
#include "hal/files/mcap_writer.hpp"

namespace dtact::mcap {
namespace {

void write(const std::string& path) {
  FileSink sink(path, true);
  Writer writer(sink, {.library = "dtact"});
  const auto schema = writer.add_schema("S", "jsonschema", "{}");
  const auto a = writer.add_channel(schema, "/a", "json", {{"unit", "mm"}});
  const auto b = writer.add_channel(0, "/b", "json");
  writer.add(Attachment{5, 4, "a.txt", "text/plain", "attached"});
  for (std::uint32_t i = 0; i < 6; ++i) {
    const std::string data = "{\"i\":" + std::to_string(i) + "}";
    writer.add(Message{i % 2 == 0 ? a : b, i, 100 + i, 90 + i, data});
    if (i == 3) writer.flush();
  }
  writer.add(Metadata{"m", {{"key", "value"}}});
  writer.finish();
}

void read(const std::string& path) {
  const Reader reader(path);
  if (!reader.damage().empty()) std::cout << "damage " << reader.damage() << '\n';
  std::set<std::string> topics;
  for (const auto& [id, channel] : reader.channels()) topics.insert(channel.topic);
  reader.read(topics, [&](const Channel& channel, const Message& message) {
    const auto schema = reader.schemas().find(channel.schema);
    std::cout << "message " << channel.topic << ' '
              << (schema == reader.schemas().end() ? "-" : schema->second.name) << ' '
              << message.sequence << ' ' << message.log_time << ' ' << message.publish_time << ' '
              << message.data << '\n';
    return true;
  });
  for (const auto& place : reader.attachments()) {
    const Attachment attachment = reader.attachment(place);
    std::cout << "attachment " << attachment.name << ' ' << attachment.media_type << ' '
              << attachment.log_time << ' ' << attachment.create_time << ' ' << attachment.data
              << '\n';
  }
  for (const auto& metadata : reader.metadata()) {
    std::cout << "metadata " << metadata.name;
    for (const auto& [key, value] : metadata.values) std::cout << ' ' << key << '=' << value;
    std::cout << '\n';
  }
}

}  // namespace
}  // namespace dtact::mcap

int main(int argc, char** argv) {
  const std::string verb = argc == 3 ? argv[1] : "";
  try {
    if (verb == "write") {
      dtact::mcap::write(argv[2]);
    } else if (verb == "read") {
      dtact::mcap::read(argv[2]);
    } else {
      std::cerr << "usage: mcap_sample write|read FILE\n";
      return 2;
    }
  } catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 1;
  }
  return 0;
}
