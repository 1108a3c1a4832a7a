#include "hal/files/mcap_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
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

/// What could not be read, and why the first of it.
struct Unreadable {
  std::uint64_t count = 0;
  std::string first;

  void add(const std::string& why) {
    if (count++ == 0) first = why;
  }
};

/// What the summary's statistics count.
struct Statistics {
  std::uint64_t messages = 0;
  std::uint64_t schemas = 0;
  std::uint64_t channels = 0;
  std::uint64_t attachments = 0;
  std::uint64_t metadata = 0;
  std::uint64_t chunks = 0;
};

Statistics take_statistics(Cursor fields) {
  Statistics statistics;
  statistics.messages = fields.take<std::uint64_t>();
  statistics.schemas = fields.take<std::uint16_t>();
  statistics.channels = fields.take<std::uint32_t>();
  statistics.attachments = fields.take<std::uint32_t>();
  statistics.metadata = fields.take<std::uint32_t>();
  statistics.chunks = fields.take<std::uint32_t>();
  return statistics;
}

}  // namespace

struct Reader::Impl {
  explicit Impl(const std::filesystem::path& path) : file(path) {}

  [[nodiscard]] std::string load_indexed(std::uint64_t offset, Op expected);

  void open();
  void read_summary(std::uint64_t footer);
  [[nodiscard]] bool lists_everything() const;
  void scan();
  void add_scanned(Op op, std::uint64_t offset, std::uint64_t length);
  void add(const Cursor::Record& record);
  void add_single(Op op, std::uint64_t offset);
  void add_attachment(std::uint64_t offset);
  void add_metadata(std::uint64_t offset);

  RecordFile file;
  std::string damage;
  std::map<std::uint16_t, Schema> schemas;
  std::map<std::uint16_t, Channel> channels;
  std::vector<Place> places;
  std::vector<AttachmentPlace> attachments;
  std::vector<Metadata> metadata;
  std::optional<Statistics> statistics;  ///< Of an intact summary.
  // What the latest read() came upon, or the scan before the first.
  Unreadable chunks;
  Unreadable messages;
  Unreadable singles;              ///< Attachments and metadata.
  std::uint64_t out_of_order = 0;  ///< Messages earlier than one before in their channel.
  std::uint64_t missing = 0;       ///< Messages that the statistics count and no chunk holds.
  std::uint64_t indexed = 0;       ///< Bytes of records that the summary's index led to.
  std::uint64_t scanned = 0;       ///< Offset of the record at which the scan ended.
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
      if (lists_everything()) return;
      why.clear();  // whole, but not everything in it is indexed
    } catch (const Error& e) {
      why = e.what();
      schemas.clear();
      channels.clear();
      places.clear();
      attachments.clear();
      metadata.clear();
      singles = {};
      statistics.reset();
    }
  }
  const std::vector<Place> of_index = std::exchange(places, {});
  const std::vector<AttachmentPlace> attachments_of_index = std::exchange(attachments, {});
  const std::vector<Metadata> metadata_of_index = std::exchange(metadata, {});
  const Unreadable singles_of_index = std::exchange(singles, {});
  indexed = 0;
  scan();
  if (!damage.empty()) {
    // Behind a record whose length is damaged the index still leads to everything else.
    const auto behind = [this](const auto& place) { return place.offset >= scanned; };
    std::ranges::copy_if(of_index, std::back_inserter(places), behind);
    std::ranges::copy_if(attachments_of_index, std::back_inserter(attachments), behind);
    if (metadata_of_index.size() > metadata.size()) metadata = metadata_of_index;
    if (singles_of_index.count > singles.count) singles = singles_of_index;
  }
  if (damage.empty()) damage = std::exchange(why, {});
}

/// Writers may leave out of the summary what they like; only the statistics show it.
bool Reader::Impl::lists_everything() const {
  return statistics && statistics->schemas == schemas.size() &&
         statistics->channels == channels.size() && statistics->chunks == places.size() &&
         statistics->attachments == attachments.size() && statistics->metadata == metadata.size() &&
         (statistics->messages == 0 || !places.empty());
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
        add_single(Op::attachment, entry.take<std::uint64_t>());
        break;
      case Op::metadata_index:
        add_single(Op::metadata, entry.take<std::uint64_t>());
        break;
      case Op::statistics:
        statistics = take_statistics(entry);
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

/// An attachment or metadata. A damaged one costs itself alone.
void Reader::Impl::add_single(Op op, std::uint64_t offset) {
  try {
    op == Op::attachment ? add_attachment(offset) : add_metadata(offset);
  } catch (const Error& e) {
    if (indexed > file.size()) throw;
    singles.add(e.what());
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

/// Scans the data. Stops at the first record outside of chunks that is damaged or truncated, and
/// reports it in `damage`.
void Reader::Impl::scan() {
  std::uint64_t offset = kMagic.size();
  try {
    for (;;) {
      scanned = offset;
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
      places.push_back({offset, true});
      try {
        const std::string records = file.load_chunk(offset);
        Cursor inside = file.cursor(records, offset);
        while (inside.left() > 0) add(inside.record());
      } catch (const Error& e) {
        chunks.add(e.what());
      }
      break;
    }
    case Op::attachment:
    case Op::metadata:
      add_single(op, offset);
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

std::string Reader::damage() const {
  std::string text = impl_->damage;
  const auto add = [&text](const std::string& sentence) {
    text += (text.empty() ? "" : "; ") + sentence;
  };
  if (const Unreadable& chunks = impl_->chunks; chunks.count > 0) {
    add(fmt::format("{} of {} chunks cannot be read, the first because of {}", chunks.count,
                    std::ranges::count(impl_->places, true, &Place::chunk), chunks.first));
  }
  if (const Unreadable& messages = impl_->messages; messages.count > 0) {
    add(fmt::format("{} message(s) cannot be read, the first because of {}", messages.count,
                    messages.first));
  }
  if (const Unreadable& singles = impl_->singles; singles.count > 0) {
    add(fmt::format("{} attachment(s) or metadata cannot be read, the first because of {}",
                    singles.count, singles.first));
  }
  if (const auto& statistics = impl_->statistics; statistics && impl_->missing > 0) {
    add(fmt::format("{} of {} messages are not there", impl_->missing, statistics->messages));
  }
  return text;
}

std::uint64_t Reader::out_of_order() const noexcept { return impl_->out_of_order; }

void Reader::count_unreadable(const std::string& why) const { impl_->messages.add(why); }

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
  Impl& impl = *impl_;
  impl.chunks = {};
  impl.messages = {};
  impl.missing = 0;
  impl.out_of_order = 0;
  std::uint64_t seen = 0;
  std::map<std::uint16_t, std::uint64_t> newest;  // log time by channel
  // False: enough. What `take` throws is its own.
  const auto offer = [&](const Cursor::Record& record) {
    const Cursor fields = impl.file.cursor(record.fields, record.offset + kRecordHead);
    ++seen;
    if (record.fields.size() < kMessageHead) {
      impl.messages.add(fmt::format("byte {}: a message without its head", record.offset));
      return true;
    }
    const Message message = take_message(fields);
    const auto channel = impl.channels.find(message.channel);
    if (channel == impl.channels.end()) {
      impl.messages.add(fmt::format("byte {}: a message of channel {}, which is not in the file",
                                    record.offset, message.channel));
      return true;
    }
    if (!topics.contains(channel->second.topic)) return true;
    std::uint64_t& latest = newest[message.channel];
    if (message.log_time < latest) ++impl.out_of_order;
    latest = std::max(latest, message.log_time);
    return take(channel->second, message);
  };
  for (const Place& place : impl.places) {
    std::string records;
    try {
      records = place.chunk ? impl.file.load_chunk(place.offset)
                            : impl.file.load_record(place.offset, Op::message);
    } catch (const Error& e) {
      impl.chunks.add(e.what());
      continue;
    }
    if (!place.chunk) {
      if (!offer({Op::message, records, place.offset})) return;
      continue;
    }
    // One after another: a list of the records can be many times as large as the chunk.
    Cursor cursor = impl.file.cursor(records, place.offset);
    while (cursor.left() > 0) {
      Cursor::Record record{};
      try {
        record = cursor.record();
      } catch (const Error& e) {
        impl.chunks.add(e.what());
        break;
      }
      if (record.op == Op::message && !offer(record)) return;
    }
  }
  if (impl.statistics && impl.statistics->messages > seen) {
    impl.missing = impl.statistics->messages - seen;
  }
}

}  // namespace dtact::mcap
