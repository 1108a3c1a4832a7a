// An MCAP file, read to its end. Only mcap::Error may be thrown.
#include "hal/files/mcap_reader.hpp"
#include "tests/fuzz/fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  const fuzz::MemoryFile file({reinterpret_cast<const char*>(data), size});
  try {
    const mcap::Reader reader(file.path());
    std::set<std::string> topics;
    for (const auto& [id, channel] : reader.channels()) topics.insert(channel.topic);
    for (const auto& place : reader.attachments()) {
      try {
        (void)reader.attachment(place);
      } catch (const mcap::Error& e) {
        fuzz::require(*e.what() != 0, "an error says something");
      }
    }
    reader.read(topics, [](const mcap::Channel& channel, const mcap::Message& message) {
      fuzz::require(channel.id == message.channel, "a message comes with its channel");
      return true;
    });
  } catch (const mcap::Error& e) {
    fuzz::require(*e.what() != 0, "an error says something");
  }
  return 0;
}
