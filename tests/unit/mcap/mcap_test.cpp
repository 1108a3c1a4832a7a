#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "hal/files/mcap_bytes.hpp"
#include "hal/files/mcap_reader.hpp"
#include "hal/files/mcap_writer.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::mcap {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::ThrowsMessage;

// A few lines of Python (struct, zlib) made both from the specification, without this code.

/// A schema, a channel, an attachment, a metadata record and their summary; no message.
constexpr const char* kWritten =
    "894d434150300d0a010c0000000000000000000000040000007465737403190000000000000001000100000053"
    "0800000070726f746f62756602000000000104240000000000000001000100020000002f740800000070726f74"
    "6f6275660a000000010000006b0100000076093500000000000000070000000000000005000000000000000500"
    "0000612e7478740a000000746578742f706c61696e02000000000000006869320a8c4d0c130000000000000001"
    "0000006d0a000000010000007801000000790f040000000000000016fdaae80319000000000000000100010000"
    "00530800000070726f746f62756602000000000104240000000000000001000100020000002f74080000007072"
    "6f746f6275660a000000010000006b01000000760a3f000000000000006c000000000000003e00000000000000"
    "07000000000000000500000000000000020000000000000005000000612e7478740a000000746578742f706c61"
    "696e0d1500000000000000aa000000000000001c00000000000000010000006d0b2e0000000000000000000000"
    "0000000001000100000001000000010000000000000000000000000000000000000000000000000000000e1100"
    "00000000000003d30000000000000022000000000000000e110000000000000004f5000000000000002d000000"
    "000000000e11000000000000000a220100000000000048000000000000000e11000000000000000d6a01000000"
    "0000001e000000000000000e11000000000000000b880100000000000037000000000000000214000000000000"
    "00d300000000000000bf01000000000000886d56cf894d434150300d0a";
/// Contents that this writer never makes: no summary, a chunk of zstd (one raw block) with its
/// channel, one without compression and CRC, a message outside of chunks, a record of a later
/// version.
constexpr const char* kScanned =
    "894d434150300d0a0109000000000000000000000001000000780698000000000000000a000000000000001400"
    "0000000000006300000000000000197da7df040000007a7374646c0000000000000028b52ffd20631903000416"
    "0000000000000000000000020000002f74040000006a736f6e000000000519000000000000000000010000000a"
    "0000000000000009000000000000006f6e65051900000000000000000002000000140000000000000013000000"
    "0000000074776f064c000000000000001e000000000000001e0000000000000024000000000000000000000000"
    "0000002400000000000000051b000000000000000000030000001e000000000000001d00000000000000746872"
    "6565051a0000000000000000000400000028000000000000002700000000000000666f75727f05000000000000"
    "006c617465720f0400000000000000000000000214000000000000000000000000000000000000000000000000"
    "000000894d434150300d0a";

std::string from_hex(std::string_view hex) {
  std::string bytes;
  for (std::size_t i = 0; i < hex.size(); i += 2) {
    unsigned value = 0;
    std::from_chars(hex.data() + i, hex.data() + i + 2, value, 16);
    bytes += static_cast<char>(value);
  }
  return bytes;
}

std::string to_hex(std::string_view bytes) {
  constexpr const char* kDigits = "0123456789abcdef";
  std::string hex;
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    hex += kDigits[byte / 16];
    hex += kDigits[byte % 16];
  }
  return hex;
}

/// Accepts up to `room` bytes.
class MemorySink final : public Sink {
 public:
  void append(std::string_view more) override {
    if (bytes.size() + more.size() > room) {
      throw std::system_error(ENOSPC, std::generic_category(), "full");
    }
    bytes += more;
  }
  void sync() override { synced = bytes.size(); }

  std::string bytes;
  std::size_t synced = 0;
  std::size_t room = std::string::npos;
};

class Mcap : public testing::Test {
 protected:
  Mcap() { fs::create_directories(folder_); }

 public:
  ~Mcap() override { fs::remove_all(folder_); }

 protected:
  [[nodiscard]] fs::path file() const { return folder_ / "a.mcap"; }
  void write(const std::string& bytes) const { std::ofstream(file(), std::ios::binary) << bytes; }
  /// All messages of "/t" as (sequence, log time, data).
  using Read = std::vector<std::tuple<std::uint32_t, std::uint64_t, std::string>>;
  static Read read(const Reader& reader) {
    Read all;
    reader.read({"/t"}, [&](const Channel& channel, const Message& message) {
      EXPECT_EQ(channel.topic, "/t");
      all.emplace_back(message.sequence, message.log_time, message.data);
      return true;
    });
    return all;
  }
  /// Three chunks of ten messages of a hundred bytes each, on two topics in turn.
  static void add_messages(Writer& writer) {
    const auto schema = writer.add_schema("S", "protobuf", "descriptor");
    const auto t = writer.add_channel(schema, "/t", "protobuf");
    const auto u = writer.add_channel(0, "/u", "json");
    for (std::uint32_t i = 0; i < 30; ++i) {
      writer.add(Message{i % 2 == 0 ? t : u, i, 1000 + i, 900 + i, std::string(100, 'a')});
      if (i % 10 == 9) writer.flush();
    }
  }

 private:
  fs::path folder_ = fakes::own_path();
};

TEST_F(Mcap, WritesTheFormat) {
  MemorySink sink;
  Writer writer(sink, {.library = "test"});
  const auto schema = writer.add_schema("S", "protobuf", std::string("\0\1", 2));
  EXPECT_EQ(schema, 1);
  EXPECT_EQ(writer.add_channel(schema, "/t", "protobuf", {{"k", "v"}}), 1);
  writer.add(Attachment{7, 5, "a.txt", "text/plain", "hi"});
  writer.add(Metadata{"m", {{"x", "y"}}});
  writer.finish();
  EXPECT_EQ(to_hex(sink.bytes), kWritten);
  EXPECT_EQ(writer.bytes(), 614U);
  EXPECT_EQ(sink.synced, 614U);
}

TEST_F(Mcap, ReadsTheFormat) {
  write(from_hex(kWritten));
  const Reader reader(file());
  EXPECT_EQ(reader.damage(), "");
  EXPECT_EQ(reader.schemas().at(1), (Schema{1, "S", "protobuf", std::string("\0\1", 2)}));
  EXPECT_EQ(reader.channels().at(1), (Channel{1, 1, "/t", "protobuf", {{"k", "v"}}}));
  ASSERT_THAT(reader.attachments(), SizeIs(1));
  const Attachment attachment = reader.attachment(reader.attachments()[0]);
  EXPECT_EQ(attachment.name, "a.txt");
  EXPECT_EQ(attachment.media_type, "text/plain");
  EXPECT_EQ(attachment.log_time, 7U);
  EXPECT_EQ(attachment.create_time, 5U);
  EXPECT_EQ(attachment.data, "hi");
  ASSERT_THAT(reader.metadata(), SizeIs(1));
  EXPECT_EQ(reader.metadata()[0].values.at("x"), "y");
  EXPECT_THAT(read(reader), IsEmpty());
}

TEST_F(Mcap, ReadsWhatOthersWrite) {
  write(from_hex(kScanned));
  const Reader reader(file());
  EXPECT_EQ(reader.damage(), "");
  EXPECT_THAT(read(reader), ElementsAre(std::tuple(1, 10, "one"), std::tuple(2, 20, "two"),
                                        std::tuple(3, 30, "three"), std::tuple(4, 40, "four")));
}

TEST_F(Mcap, ReadsBackWhatItWrote) {
  MemorySink sink;
  Writer writer(sink);
  add_messages(writer);
  writer.finish();
  // A hundred equal bytes a message: they are compressed.
  EXPECT_LT(sink.bytes.size(), 2500U);
  write(sink.bytes);
  const Reader reader(file());
  EXPECT_EQ(reader.damage(), "");
  const Read messages = read(reader);
  ASSERT_THAT(messages, SizeIs(15));
  EXPECT_EQ(messages[14], std::tuple(28U, 1028U, std::string(100, 'a')));
  int taken = 0;
  reader.read({"/t", "/u"}, [&](const Channel&, const Message&) { return ++taken < 7; });
  EXPECT_EQ(taken, 7);
}

TEST_F(Mcap, WritesAChunkWhenItIsFull) {
  MemorySink sink;
  Writer writer(sink, {.chunk_bytes = 1000});
  const auto channel = writer.add_channel(0, "/t", "json");
  const auto empty = writer.bytes();
  for (std::uint32_t i = 0; i < 7; ++i)
    writer.add(Message{channel, i, i, i, std::string(100, 'x')});
  EXPECT_EQ(writer.bytes(), empty);
  EXPECT_EQ(writer.open_bytes(), 7 * 131U);
  writer.add(Message{channel, 7, 7, 7, std::string(100, 'x')});
  EXPECT_GT(writer.bytes(), empty);
  EXPECT_EQ(writer.open_bytes(), 0U);
  EXPECT_EQ(sink.synced, sink.bytes.size());
  EXPECT_THROW(writer.add(Message{9, 0, 0, 0, ""}), std::invalid_argument);
  EXPECT_THROW(writer.add(Message{0, 0, 0, 0, ""}), std::invalid_argument);
  EXPECT_THROW(writer.add(Message{2, 0, 0, 0, ""}), std::invalid_argument);
}

// A message takes 31 bytes and its data.
TEST_F(Mcap, AChunkThatIsExactlyFullIsWritten) {
  MemorySink sink;
  Writer writer(sink, {.chunk_bytes = 2 * (31 + 100)});
  const auto channel = writer.add_channel(0, "/t", "json");
  EXPECT_EQ(writer.written(channel), 0U);
  writer.add(Message{channel, 1, 10, 9, std::string(99, 'x')});
  writer.add(Message{channel, 2, 20, 9, std::string(100, 'x')});
  EXPECT_EQ(writer.open_bytes(), 261U);
  writer.flush();
  writer.add(Message{channel, 3, 30, 9, std::string(100, 'x')});
  writer.add(Message{channel, 4, 40, 9, std::string(100, 'x')});
  EXPECT_EQ(writer.open_bytes(), 0U);
  EXPECT_EQ(writer.written(channel), 4U);
}

TEST_F(Mcap, AnAttachmentIsReadIfItsCrcIsRightOrLeftOut) {
  MemorySink sink;
  Writer writer(sink);
  writer.add(Attachment{7, 5, "a.txt", "text/plain", "hello"});
  const std::size_t crc = sink.bytes.size() - 4;
  writer.finish();
  const auto data_of = [&](const std::string& bytes) {
    write(bytes);
    const Reader reader(file());
    return reader.attachment(reader.attachments().at(0)).data;
  };
  EXPECT_EQ(data_of(sink.bytes), "hello");
  std::string without = sink.bytes;
  without.replace(crc, 4, 4, '\0');
  EXPECT_EQ(data_of(without), "hello");
  std::string changed = sink.bytes;
  changed[crc - 1] = 'O';
  EXPECT_THAT([&] { (void)data_of(changed); },
              ThrowsMessage<Error>(HasSubstr("an attachment's CRC is wrong")));
}

// The file of a killed writer, cut at every byte: every whole chunk is read.
TEST_F(Mcap, ReadsACutFileUpToItsLastWholeChunk) {
  MemorySink sink;
  Writer writer(sink);
  add_messages(writer);
  const std::size_t data = sink.bytes.size();
  writer.finish();
  std::size_t before = 0;
  for (std::size_t length = kMagic.size(); length < sink.bytes.size(); ++length) {
    write(sink.bytes.substr(0, length));
    const Reader reader(file());
    EXPECT_NE(reader.damage(), "") << length;
    const std::size_t messages = read(reader).size();
    EXPECT_TRUE(messages == before || messages == before + 5) << length;
    before = messages;
    if (length == data) {
      EXPECT_EQ(messages, 15U);
      EXPECT_THAT(reader.damage(),
                  HasSubstr("byte " + std::to_string(data) + ": the file ends without a summary"));
    }
  }
}

TEST_F(Mcap, AFullDiskLosesTheOpenChunkOnly) {
  MemorySink sink;
  Writer writer(sink);
  add_messages(writer);
  const auto channel = writer.add_channel(0, "/v", "json");
  sink.room = sink.bytes.size() + 1000;
  std::string noise;
  for (unsigned i = 0; i < 5000; ++i) noise += static_cast<char>(i * i * 2654435761U >> 13U);
  writer.add(Message{channel, 0, 2000, 2000, noise});
  EXPECT_THROW(writer.flush(), std::system_error);
  EXPECT_EQ(writer.open_bytes(), 0U);
  writer.finish();  // fits into the rest
  write(sink.bytes);
  const Reader reader(file());
  EXPECT_EQ(reader.damage(), "");
  EXPECT_THAT(read(reader), SizeIs(15));
}

TEST_F(Mcap, SaysWhereAFileIsDamaged) {
  const auto failure = [this](const std::string& bytes) {
    write(bytes);
    return [this] { (void)read(Reader(file())); };
  };
  EXPECT_THAT(failure("\x89PNG"), ThrowsMessage<Error>(HasSubstr("is no MCAP file")));
  EXPECT_THAT(failure(""), ThrowsMessage<Error>(HasSubstr("is no MCAP file")));
  MemorySink sink;
  Writer writer(sink);
  const auto channel = writer.add_channel(0, "/t", "json");
  const auto begin = writer.bytes();
  writer.add(Message{channel, 1, 1, 1, "one"});
  writer.finish();
  // The last byte of the compressed records.
  std::string flipped = sink.bytes;
  const std::size_t index = flipped.find(std::string("\x07\x16\0\0\0\0\0\0\0", 9));
  ASSERT_NE(index, std::string::npos);
  flipped[index - 1] = static_cast<char>(flipped[index - 1] ^ 1);
  const auto damage = [this](const std::string& bytes) {
    write(bytes);
    const Reader reader(file());
    EXPECT_THAT(read(reader), IsEmpty());
    return reader.damage();
  };
  EXPECT_THAT(damage(flipped), AllOf(HasSubstr("1 of 1 chunks cannot be read, the first because"),
                                     HasSubstr("a.mcap: byte "), HasSubstr("1 of 1 messages")));
  // The size in its header.
  std::string huge = sink.bytes;
  huge[begin + kRecordHead + 16 + 7] = '\x7f';
  EXPECT_THAT(damage(huge), HasSubstr("at most 268435456 are read"));
  // A byte of the summary is damaged: the reader scans the data instead.
  std::string summary = sink.bytes;
  summary[summary.size() - 60] = static_cast<char>(summary[summary.size() - 60] ^ 1);
  write(summary);
  const Reader reader(file());
  EXPECT_THAT(reader.damage(), HasSubstr("the summary's CRC is wrong"));
  EXPECT_THAT(read(reader), SizeIs(1));
  EXPECT_THROW(Reader(file().string() + "x"), std::system_error);
}

/// A file as other writers leave it: the records of `data` and of `summary`, without a CRC.
std::string file_of(const std::string& data, const std::string& summary) {
  std::string bytes(kMagic);
  put_record(bytes, Op::header, std::string(8, '\0'));
  bytes += data;
  put_record(bytes, Op::data_end, std::string(4, '\0'));
  std::string footer;
  put(footer, summary.empty() ? std::uint64_t{0} : std::uint64_t{bytes.size()});
  put(footer, std::uint64_t{0});
  put(footer, std::uint32_t{0});
  bytes += summary;
  put_record(bytes, Op::footer, footer);
  return bytes + std::string(kMagic);
}
std::string channel_of(std::uint16_t id, const std::string& topic) {
  std::string fields;
  put(fields, id);
  put(fields, std::uint16_t{0});
  put_string(fields, topic);
  put_string(fields, "json");
  put_map(fields, {});
  std::string record;
  put_record(record, Op::channel, fields);
  return record;
}
std::string message_of(std::uint16_t channel, std::uint32_t sequence, std::uint64_t time) {
  std::string fields;
  put(fields, channel);
  put(fields, sequence);
  put(fields, time);
  put(fields, time);
  std::string record;
  put_record(record, Op::message, fields + "x");
  return record;
}
/// Not compressed.
std::string chunk_of(const std::string& records) {
  std::string fields(16, '\0');
  put(fields, std::uint64_t{records.size()});
  put(fields, crc32(records));
  put_string(fields, "");
  put(fields, std::uint64_t{records.size()});
  std::string record;
  put_record(record, Op::chunk, fields + records);
  return record;
}
std::string attachment_of(const std::string& name) {
  std::string fields(16, '\0');
  put_string(fields, name);
  put_string(fields, "text/plain");
  put(fields, std::uint64_t{0});
  put(fields, std::uint32_t{0});
  std::string record;
  put_record(record, Op::attachment, fields);
  return record;
}
std::string index_of(std::uint64_t chunk) {
  std::string fields(16, '\0');
  put(fields, chunk);
  std::string record;
  put_record(record, Op::chunk_index, fields);
  return record;
}
std::string statistics_of(std::uint64_t messages, std::uint32_t channels, std::uint32_t attachments,
                          std::uint32_t chunks) {
  std::string fields;
  put(fields, messages);
  put(fields, std::uint16_t{0});
  put(fields, channels);
  put(fields, attachments);
  put(fields, std::uint32_t{0});
  put(fields, chunks);
  std::string record;
  put_record(record, Op::statistics, fields);
  return record;
}
/// Where file_of() puts `data`.
constexpr std::uint64_t kData = 8 + kRecordHead + 8;

// Neither is in the summary, whose writer may leave out what it likes.
TEST_F(Mcap, FindsChannelsAndAttachmentsThatTheSummaryLeavesOut) {
  const std::string data =
      chunk_of(channel_of(3, "/t") + message_of(3, 1, 10)) + attachment_of("a");
  for (const std::string& statistics : {std::string(), statistics_of(1, 1, 1, 1)}) {
    write(file_of(data, index_of(kData) + statistics));
    const Reader reader(file());
    EXPECT_THAT(reader.channels(), SizeIs(1));
    ASSERT_THAT(reader.attachments(), SizeIs(1));
    EXPECT_EQ(reader.attachments()[0].name, "a");
    EXPECT_THAT(read(reader), ElementsAre(std::tuple(1, 10, "x")));
    EXPECT_EQ(reader.damage(), "");
  }
}

TEST_F(Mcap, PassesOverWhatIsDamagedAndCountsIt) {
  std::string broken = chunk_of(message_of(3, 2, 20));
  broken.back() = 'y';  // its CRC
  const std::string data =
      channel_of(3, "/t") + chunk_of(message_of(3, 1, 10)) + broken +
      chunk_of(message_of(3, 4, 40) + message_of(7, 9, 41) + message_of(3, 3, 30)) +
      message_of(3, 5, 50);
  write(file_of(data, ""));
  const Reader reader(file());
  EXPECT_THAT(read(reader), ElementsAre(std::tuple(1, 10, "x"), std::tuple(4, 40, "x"),
                                        std::tuple(3, 30, "x"), std::tuple(5, 50, "x")));
  EXPECT_THAT(reader.damage(),
              AllOf(HasSubstr("1 of 3 chunks cannot be read, the first because of "),
                    HasSubstr("CRC is wrong"), HasSubstr("1 message(s) cannot be read"),
                    HasSubstr("channel 7")));
  EXPECT_EQ(reader.out_of_order(), 1U);
}

TEST_F(Mcap, ReportsMessagesThatAreCountedAndNotThere) {
  const std::string data = channel_of(3, "/t") + chunk_of(message_of(3, 1, 10));
  write(file_of(data, channel_of(3, "/t") + index_of(kData + channel_of(3, "/t").size()) +
                          statistics_of(3, 1, 0, 1)));
  const Reader reader(file());
  EXPECT_THAT(read(reader), SizeIs(1));
  EXPECT_EQ(reader.damage(), "2 of 3 messages are not there");
}

// The scan ends at the damaged length, and the index leads on.
TEST_F(Mcap, GoesOnBehindARecordWithoutALengthByTheIndex) {
  const std::string first = chunk_of(channel_of(3, "/t") + message_of(3, 1, 10));
  std::string second = chunk_of(message_of(3, 2, 20));
  second[8] = '\x7f';
  const std::string third = chunk_of(message_of(3, 3, 30));
  write(file_of(first + second + third, index_of(kData) + index_of(kData + first.size()) +
                                            index_of(kData + first.size() + second.size()) +
                                            statistics_of(3, 1, 0, 3)));
  const Reader reader(file());
  EXPECT_THAT(read(reader), ElementsAre(std::tuple(1, 10, "x"), std::tuple(3, 30, "x")));
  EXPECT_THAT(reader.damage(), AllOf(HasSubstr("1 of 3 chunks"), HasSubstr("1 of 3 messages")));
}

std::string attachment_index_of(std::uint64_t attachment) {
  std::string fields;
  put(fields, attachment);
  std::string record;
  put_record(record, Op::attachment_index, fields + std::string(40, '\0'));
  return record;
}

// Its head or its fields: everything else is read, with the index and without.
TEST_F(Mcap, ADamagedAttachmentCostsItselfAlone) {
  const std::string first = chunk_of(channel_of(3, "/t") + message_of(3, 1, 10));
  const std::string second = chunk_of(message_of(3, 2, 20));
  const std::string whole = attachment_of("b");
  std::string no_head = attachment_of("a");
  no_head.replace(0, kRecordHead, kRecordHead, '\0');
  std::string no_name = attachment_of("a");
  no_name[kRecordHead + 16 + 3] = '\x7f';
  const auto data = [&](const std::string& damaged) { return first + damaged + second + whole; };
  const auto summary = [&](const std::string& damaged) {
    const std::uint64_t attachment = kData + first.size();
    const std::uint64_t chunk = attachment + damaged.size();
    return channel_of(3, "/t") + index_of(kData) + index_of(chunk) +
           attachment_index_of(attachment) + attachment_index_of(chunk + second.size()) +
           statistics_of(2, 1, 2, 2);
  };
  for (const std::string& bytes :
       {file_of(data(no_head), summary(no_head)), file_of(data(no_name), summary(no_name)),
        file_of(data(no_name), "")}) {
    write(bytes);
    const Reader reader(file());
    EXPECT_THAT(read(reader), ElementsAre(std::tuple(1, 10, "x"), std::tuple(2, 20, "x")));
    ASSERT_THAT(reader.attachments(), SizeIs(1));
    EXPECT_EQ(reader.attachments()[0].name, "b");
    EXPECT_THAT(reader.damage(), HasSubstr("1 attachment(s) or metadata cannot be read"));
  }
}

// What a broken summary says counts for nothing, however far the scan comes.
TEST_F(Mcap, ABrokenSummaryAddsNoAttachmentToADamagedFile) {
  const std::string whole = attachment_of("a");
  std::string no_head = attachment_of("b");
  no_head.replace(0, kRecordHead, kRecordHead, '\0');
  const std::uint64_t behind = kData + whole.size() + no_head.size();
  write(file_of(whole + no_head + attachment_of("c"),
                attachment_index_of(behind) + index_of(kData) + index_of(kData)));
  const Reader reader(file());
  ASSERT_THAT(reader.attachments(), SizeIs(1));
  EXPECT_EQ(reader.attachments()[0].name, "a");
}

TEST_F(Mcap, AnIndexThatPointsAtARecordAgainAndAgainIsLeft) {
  MemorySink sink;
  Writer writer(sink);
  writer.add(Metadata{"m", {{"long", std::string(10'000, 'x')}}});
  writer.finish();
  // The index's record: its kind, length, place, the other's length and name.
  const std::size_t at = sink.bytes.find(std::string("\x0d\x15\0\0\0\0\0\0\0", 9));
  ASSERT_NE(at, std::string::npos);
  const std::string entry = sink.bytes.substr(at, 9 + 0x15);
  std::string bytes = sink.bytes;
  for (int i = 0; i < 5; ++i) bytes.insert(at, entry);
  // The summary's CRC: none.
  bytes.replace(bytes.size() - 12, 4, 4, '\0');
  write(bytes);
  const Reader reader(file());
  EXPECT_THAT(reader.damage(), HasSubstr("in the index more than once"));
  EXPECT_THAT(reader.metadata(), SizeIs(1));
}

TEST_F(Mcap, RefusesAMapOfManyEntries) {
  std::string entries;
  for (std::uint32_t i = 0; i < 65'537; ++i) {
    put_string(entries, std::to_string(i));
    put_string(entries, "");
  }
  std::string fields;
  put_string(fields, "many");
  put_string(fields, entries);
  std::string record;
  put_record(record, Op::metadata, fields);
  write(file_of(record, ""));
  const Reader reader(file());
  EXPECT_THAT(reader.damage(), HasSubstr("a map has more than 65536 entries"));
  EXPECT_THAT(reader.metadata(), IsEmpty());
}

#ifndef __SANITIZE_ADDRESS__  // which takes address space of its own
// Before: a list of the chunk's records took four times its size and more.
TEST_F(Mcap, ManySmallRecordsTakeNoMoreMemoryThanTheirChunk) {
  constexpr std::size_t kRecords = 2'000'000;
  std::string records;
  for (std::size_t i = 0; i < kRecords; ++i) put_record(records, static_cast<Op>(0x70), "");
  write(file_of(channel_of(1, "/t") + chunk_of(records + message_of(1, 7, 8)), ""));
  const Reader reader(file());
  const auto read_with_little = [&] {
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    const std::size_t bytes = pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
    const rlimit limit{bytes + 3 * records.size(), bytes + 3 * records.size()};
    ::setrlimit(RLIMIT_AS, &limit);
    return read(reader).size() == 1 ? 0 : 1;
  };
  EXPECT_EXIT(std::exit(read_with_little()), testing::ExitedWithCode(0), "");
}
#endif

TEST_F(Mcap, RefusesLz4BySayingWhatToDo) {
  std::string bytes = from_hex(kScanned);
  bytes.replace(bytes.find("zstd"), 4, "lz4x");
  write(bytes);
  EXPECT_THAT(Reader(file()).damage(), HasSubstr("only zstd is read"));
}

TEST_F(Mcap, AFileIsNotReplacedUnasked) {
  write("mine");
  EXPECT_THROW(FileSink(file(), false), std::system_error);
  EXPECT_EQ(base::read_file(file()), "mine");
  {
    FileSink sink(file(), true);
    sink.append("yours");
    sink.sync();
  }
  EXPECT_EQ(base::read_file(file()), "yours");
}

// The kernel takes the first bytes of "lost" and refuses the rest, as on a full disk: no part of it
// stays, and what comes later is written behind what came before.
TEST_F(Mcap, WhatIsNotWrittenWholeIsTakenBack) {
  FileSink sink(file(), true);
  sink.append("first");
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit few{7, before.rlim_max};
  auto* const handler = std::signal(SIGXFSZ, SIG_IGN);
  ::setrlimit(RLIMIT_FSIZE, &few);
  EXPECT_THAT([&] { sink.append("lost"); },
              ThrowsMessage<std::system_error>(HasSubstr("a.mcap: File too large")));
  ::setrlimit(RLIMIT_FSIZE, &before);
  (void)std::signal(SIGXFSZ, handler);
  EXPECT_EQ(base::read_file(file()), "first");
  sink.append(", then");
  sink.append(" more");
  EXPECT_EQ(base::read_file(file()), "first, then more");
}

TEST_F(Mcap, ErrorsNameTheFileAsItIsCalled) {
  EXPECT_THAT([&] { const FileSink sink(file().parent_path() / "none" / "a", true, "press.mcap"); },
              ThrowsMessage<std::system_error>(
                  AllOf(HasSubstr("press.mcap: No such file"), testing::Not(HasSubstr("none")))));
}

// /dev/full refuses every byte.
TEST_F(Mcap, NamesTheFileThatTakesNoMore) {
  FileSink sink("/dev/full", true);
  EXPECT_THAT([&] { sink.append("x"); },
              ThrowsMessage<std::system_error>(
                  AllOf(HasSubstr("/dev/full"), HasSubstr("No space left on device"))));
}

}  // namespace
}  // namespace dtact::mcap
