#include "hal/files/mcap_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "hal/files/mcap_record_file.hpp"

namespace dtact::mcap {
namespace {

/// Before a message's data.
constexpr std::uint64_t kMessageHead = 22;

/// Somewhere in the file messages lie: in a chunk, or one outside of any.
struct Place {
  std::uint64_t offset = 0;  ///< position of the record
  bool chunk = true;
};

Schema take_schema(Cursor fields) {
  Schema schema;
  schema.id = fields.take<std::uint16_t>();
  schema.name = fields.string();
  schema.encoding = fields.string();
  schema.data = fields.string();
  return schema;
}

Channel take_channel(Cursor fields) {
  Channel channel;
  channel.id = fields.take<std::uint16_t>();
  channel.schema = fields.take<std::uint16_t>();
  channel.topic = fields.string();
  channel.message_encoding = fields.string();
  channel.metadata = fields.map();
  return channel;
}

Message take_message(Cursor fields) {
  Message message;
  message.channel = fields.take<std::uint16_t>();
  message.sequence = fields.take<std::uint32_t>();
  message.log_time = fields.take<std::uint64_t>();
  message.publish_time = fields.take<std::uint64_t>();
  message.data = fields.rest();
  return message;
}

}  // namespace

struct Reader::Impl {
  explicit Impl(const std::filesystem::path& path) : file(path) {}

  [[nodiscard]] std::string load_indexed(std::uint64_t offset, Op expected);

  void open();
  void read_summary(std::uint64_t footer);
  void scan();
  void add_scanned(Op op, std::uint64_t offset, std::uint64_t length);
  void add(const Cursor::Record& record);
  void add_attachment(std::uint64_t offset);
  void add_metadata(std::uint64_t offset);

  RecordFile file;
  std::string damage;
  std::map<std::uint16_t, Schema> schemas;
  std::map<std::uint16_t, Channel> channels;
  std::vector<Place> places;
  std::vector<AttachmentPlace> attachments;
  std::vector<Metadata> metadata;
  std::uint64_t indexed = 0;  ///< Bytes of records that the summary's index led to.
};

/// Records do not overlap: those of a whole file have no more bytes than it, however often a
/// damaged one points at one of them.
std::string Reader::Impl::load_indexed(std::uint64_t offset, Op expected) {
  std::string record = file.load_record(offset, expected);
  indexed += kRecordHead + record.size();
  if (indexed > file.size()) file.fail(offset, "a record is in the index more than once");
  return record;
}

void Reader::Impl::open() {
  if (file.size() < kMagic.size() || file.load(0, kMagic.size()) != kMagic) {
    throw Error(file.name() + ": is no MCAP file");
  }
  const std::uint64_t tail = kRecordHead + kFooterLength + kMagic.size();
  std::string why = "ends without a summary";
  if (file.size() >= kMagic.size() + tail &&
      file.load(file.size() - kMagic.size(), kMagic.size()) == kMagic) {
    try {
      read_summary(file.size() - tail);
      if (!places.empty()) return;
      why.clear();  // whole, but nothing in it is indexed
    } catch (const Error& e) {
      why = e.what();
    }
  }
  schemas.clear();
  channels.clear();
  attachments.clear();
  metadata.clear();
  indexed = 0;
  scan();
  if (damage.empty()) damage = std::exchange(why, {});
}

void Reader::Impl::read_summary(std::uint64_t footer) {
  const std::string fields = file.load_record(footer, Op::footer);
  Cursor end = file.cursor(fields, footer + kRecordHead);
  const auto begin = end.take<std::uint64_t>();
  (void)end.take<std::uint64_t>();
  const auto expected = end.take<std::uint32_t>();
  if (begin == 0) return;
  if (begin > footer) file.fail(footer, "the summary begins behind its end");
  const std::uint64_t counted = footer + kRecordHead + 16;  // up to the CRC
  const std::string summary = file.load(begin, counted - begin);
  if (expected != 0 && crc32(summary) != expected) file.fail(begin, "the summary's CRC is wrong");
  Cursor records =
      file.cursor(std::string_view(summary).substr(0, summary.size() - kRecordHead - 16), begin);
  while (records.left() > 0) {
    const auto record = records.record();
    Cursor entry = file.cursor(record.fields, record.offset + kRecordHead);
    switch (record.op) {
      case Op::chunk_index: {
        (void)entry.bytes(16);
        const auto offset = entry.take<std::uint64_t>();
        if (offset >= begin) entry.fail("a chunk lies behind the data");
        places.push_back({offset, true});
        break;
      }
      case Op::attachment_index:
        add_attachment(entry.take<std::uint64_t>());
        break;
      case Op::metadata_index:
        add_metadata(entry.take<std::uint64_t>());
        break;
      default:
        add(record);
    }
  }
  std::ranges::sort(places, {}, &Place::offset);
  const auto twice = std::ranges::adjacent_find(places, {}, &Place::offset);
  if (twice != places.end()) file.fail(twice->offset, "a chunk is in the index more than once");
  std::ranges::sort(attachments, {}, &AttachmentPlace::offset);
}

void Reader::Impl::add(const Cursor::Record& record) {
  const Cursor fields = file.cursor(record.fields, record.offset + kRecordHead);
  if (record.op == Op::schema) {
    Schema schema = take_schema(fields);
    if (schema.id == 0) return;  // invalid, and to be ignored
    const auto [known, added] = schemas.emplace(schema.id, schema);
    if (!added && known->second != schema) fields.fail("two schemas have one id");
  } else if (record.op == Op::channel) {
    Channel channel = take_channel(fields);
    const auto [known, added] = channels.emplace(channel.id, channel);
    if (!added && known->second != channel) fields.fail("two channels have one id");
  }
}

void Reader::Impl::add_attachment(std::uint64_t offset) {
  const std::string record = load_indexed(offset, Op::attachment);
  Cursor fields = file.cursor(record, offset + kRecordHead);
  AttachmentPlace place;
  place.log_time = fields.take<std::uint64_t>();
  place.create_time = fields.take<std::uint64_t>();
  place.name = fields.string();
  place.media_type = fields.string();
  place.offset = offset;
  attachments.push_back(std::move(place));
}

void Reader::Impl::add_metadata(std::uint64_t offset) {
  const std::string record = load_indexed(offset, Op::metadata);
  Cursor fields = file.cursor(record, offset + kRecordHead);
  std::string key = fields.string();
  metadata.push_back({std::move(key), fields.map()});
}

/// Scans the data. Stops at the first damaged or truncated record and reports it in `damage`.
void Reader::Impl::scan() {
  std::uint64_t offset = kMagic.size();
  try {
    for (;;) {
      if (offset == file.size()) file.fail(offset, "the file ends without a summary");
      const std::string head = file.load(offset, kRecordHead);
      Cursor fields = file.cursor(head, offset);
      const auto op = static_cast<Op>(fields.take<std::uint8_t>());
      const auto length = fields.take<std::uint64_t>();
      if (op == Op::data_end || op == Op::footer) return;
      if (length > file.size() - offset - kRecordHead) {
        file.fail(offset, fmt::format("the file ends at {} within a record", file.size()));
      }
      add_scanned(op, offset, length);
      offset += kRecordHead + length;
    }
  } catch (const Error& e) {
    damage = e.what();
  }
}

void Reader::Impl::add_scanned(Op op, std::uint64_t offset, std::uint64_t length) {
  switch (op) {
    case Op::schema:
    case Op::channel: {
      const std::string fields = file.load(offset + kRecordHead, length);
      add({op, fields, offset});
      break;
    }
    case Op::message:
      if (length < kMessageHead) file.fail(offset, "a message without its head");
      places.push_back({offset, false});
      break;
    case Op::chunk: {
      const std::string records = file.load_chunk(offset);
      Cursor inside = file.cursor(records, offset);
      while (inside.left() > 0) add(inside.record());
      places.push_back({offset, true});
      break;
    }
    case Op::attachment:
      add_attachment(offset);
      break;
    case Op::metadata:
      add_metadata(offset);
      break;
    default:
      // Indexes of what is read anyway, and what a later version of the format knows.
      if (static_cast<int>(op) == 0) file.fail(offset, "no record begins with 0");
  }
}

Reader::Reader(const std::filesystem::path& path) : impl_(std::make_unique<Impl>(path)) {
  impl_->open();
}

Reader::~Reader() = default;

const std::string& Reader::damage() const noexcept { return impl_->damage; }
const std::map<std::uint16_t, Schema>& Reader::schemas() const noexcept { return impl_->schemas; }
const std::map<std::uint16_t, Channel>& Reader::channels() const noexcept {
  return impl_->channels;
}
const std::vector<AttachmentPlace>& Reader::attachments() const noexcept {
  return impl_->attachments;
}
const std::vector<Metadata>& Reader::metadata() const noexcept { return impl_->metadata; }

Attachment Reader::attachment(const AttachmentPlace& place) const {
  const std::string record = impl_->file.load_record(place.offset, Op::attachment);
  Cursor fields = impl_->file.cursor(record, place.offset + kRecordHead);
  Attachment attachment;
  attachment.log_time = fields.take<std::uint64_t>();
  attachment.create_time = fields.take<std::uint64_t>();
  attachment.name = fields.string();
  attachment.media_type = fields.string();
  attachment.data = fields.bytes(fields.take<std::uint64_t>());
  const std::uint32_t counted = crc32(fields.taken());
  if (const auto expected = fields.take<std::uint32_t>(); expected != 0 && counted != expected) {
    fields.fail("an attachment's CRC is wrong");
  }
  return attachment;
}

void Reader::read(const std::set<std::string>& topics,
                  const std::function<bool(const Channel&, const Message&)>& take) const {
  // False: enough.
  const auto offer = [&](const Cursor::Record& record) {
    const Cursor fields = impl_->file.cursor(record.fields, record.offset + kRecordHead);
    const Message message = take_message(fields);
    const auto channel = impl_->channels.find(message.channel);
    if (channel == impl_->channels.end()) {
      fields.fail(
          fmt::format("a message of channel {}, which is not in the file", message.channel));
    }
    return !topics.contains(channel->second.topic) || take(channel->second, message);
  };
  for (const Place& place : impl_->places) {
    if (place.chunk) {
      const std::string records = impl_->file.load_chunk(place.offset);
      Cursor inside = impl_->file.cursor(records, place.offset);
      while (inside.left() > 0) {
        const auto record = inside.record();
        if (record.op == Op::message && !offer(record)) return;
      }
    } else {
      const std::string fields = impl_->file.load_record(place.offset, Op::message);
      if (!offer({Op::message, fields, place.offset})) return;
    }
  }
}

}  // namespace dtact::mcap
