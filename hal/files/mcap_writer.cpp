#include "hal/files/mcap_writer.hpp"

#include <zstd.h>

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <utility>

#include "hal/files/mcap_bytes.hpp"

namespace dtact::mcap {
namespace {

/// Messages of one channel in a chunk: log time and position within the chunk.
using Places = std::vector<std::pair<std::uint64_t, std::uint64_t>>;

struct Times {
  std::uint64_t first = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t last = 0;
  void add(const Times& other) {
    first = std::min(first, other.first);
    last = std::max(last, other.last);
  }
  /// Zero where there are none, as the format wants it.
  void put_to(std::string& out) const {
    put(out, std::min(first, last));
    put(out, last);
  }
};

struct Chunk {
  std::string records;
  std::map<std::uint16_t, Places> places;
  Times times;
};

}  // namespace

struct Writer::Impl {
  Impl(Sink& s, const WriterOptions& o) : sink(s), options(o) {}

  void append(std::string_view bytes) {
    sink.append(bytes);
    offset += bytes.size();
    crc = crc32(bytes, crc);
  }
  void append_record(Op op, std::string_view fields) {
    std::string record;
    put_record(record, op, fields);
    append(record);
  }
  void write(const Chunk& chunk);
  [[nodiscard]] std::string end() const;
  [[nodiscard]] std::string statistics() const;

  Sink& sink;
  WriterOptions options;
  struct FreeContext {
    void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  };
  std::unique_ptr<ZSTD_CCtx, FreeContext> zstd{ZSTD_createCCtx()};
  std::string compressed;

  std::uint64_t offset = 0;
  std::uint32_t crc = 0;
  Chunk open;
  // What the summary repeats, as records.
  std::string schemas;
  std::string channels;
  std::string chunk_indexes;
  std::string attachment_indexes;
  std::string metadata_indexes;
  std::uint16_t schema_count = 0;
  std::uint16_t channel_count = 0;
  std::uint32_t attachment_count = 0;
  std::uint32_t metadata_count = 0;
  std::uint32_t chunk_count = 0;
  std::map<std::uint16_t, std::uint64_t> message_counts;
  Times times;
};

void Writer::Impl::write(const Chunk& chunk) {
  compressed.resize(ZSTD_compressBound(chunk.records.size()));
  const std::size_t size =
      ZSTD_compressCCtx(zstd.get(), compressed.data(), compressed.size(), chunk.records.data(),
                        chunk.records.size(), options.level);
  if (ZSTD_isError(size) != 0U) throw std::runtime_error(ZSTD_getErrorName(size));

  std::string fields;
  chunk.times.put_to(fields);
  put(fields, std::uint64_t{chunk.records.size()});
  put(fields, crc32(chunk.records));
  put_string(fields, "zstd");
  put(fields, std::uint64_t{size});
  fields.append(compressed, 0, size);
  std::string bytes;
  put_record(bytes, Op::chunk, fields);
  const std::size_t chunk_length = bytes.size();

  std::string offsets;
  for (const auto& [channel, places] : chunk.places) {
    put(offsets, channel);
    put(offsets, offset + bytes.size());
    std::string entries;
    for (const auto& [time, place] : places) {
      put(entries, time);
      put(entries, place);
    }
    std::string index;
    put(index, channel);
    put_string(index, entries);
    put_record(bytes, Op::message_index, index);
  }
  const std::uint64_t begin = offset;
  append(bytes);

  std::string index;
  chunk.times.put_to(index);
  put(index, begin);
  put(index, std::uint64_t{chunk_length});
  put_string(index, offsets);
  put(index, std::uint64_t{bytes.size() - chunk_length});
  put_string(index, "zstd");
  put(index, std::uint64_t{size});
  put(index, std::uint64_t{chunk.records.size()});
  put_record(chunk_indexes, Op::chunk_index, index);
  ++chunk_count;
  times.add(chunk.times);
  for (const auto& [channel, places] : chunk.places) message_counts[channel] += places.size();
}

std::string Writer::Impl::statistics() const {
  std::string fields;
  std::string counts;
  std::uint64_t messages = 0;
  for (const auto& [channel, count] : message_counts) {
    put(counts, channel);
    put(counts, count);
    messages += count;
  }
  put(fields, messages);
  put(fields, schema_count);
  put(fields, std::uint32_t{channel_count});
  put(fields, attachment_count);
  put(fields, metadata_count);
  put(fields, chunk_count);
  times.put_to(fields);
  put_string(fields, counts);
  std::string record;
  put_record(record, Op::statistics, fields);
  return record;
}

/// From the end of the data to the end of the file.
std::string Writer::Impl::end() const {
  std::string out;
  std::string fields;
  put(fields, crc);
  put_record(out, Op::data_end, fields);

  const std::size_t summary = out.size();
  std::string offsets;
  const auto add_group = [&](Op op, const std::string& records) {
    if (records.empty()) return;
    std::string group;
    group += static_cast<char>(op);
    put(group, offset + out.size());
    put(group, std::uint64_t{records.size()});
    put_record(offsets, Op::summary_offset, group);
    out += records;
  };
  add_group(Op::schema, schemas);
  add_group(Op::channel, channels);
  add_group(Op::chunk_index, chunk_indexes);
  add_group(Op::attachment_index, attachment_indexes);
  add_group(Op::metadata_index, metadata_indexes);
  add_group(Op::statistics, statistics());
  const std::uint64_t offsets_begin = offset + out.size();
  out += offsets;

  out += static_cast<char>(Op::footer);
  put(out, std::uint64_t{kFooterLength});
  put(out, offset + summary);
  put(out, offsets_begin);
  put(out, crc32(std::string_view(out).substr(summary)));
  out += kMagic;
  return out;
}

Writer::Writer(Sink& sink, const WriterOptions& options)
    : impl_(std::make_unique<Impl>(sink, options)) {
  std::string fields;
  put_string(fields, options.profile);
  put_string(fields, options.library);
  std::string begin(kMagic);
  put_record(begin, Op::header, fields);
  impl_->append(begin);
}

Writer::~Writer() = default;

std::uint16_t Writer::add_schema(const std::string& name, const std::string& encoding,
                                 const std::string& data) {
  const auto id = static_cast<std::uint16_t>(impl_->schema_count + 1U);
  std::string fields;
  put(fields, id);
  put_string(fields, name);
  put_string(fields, encoding);
  put_string(fields, data);
  impl_->append_record(Op::schema, fields);
  put_record(impl_->schemas, Op::schema, fields);
  impl_->schema_count = id;
  return id;
}

std::uint16_t Writer::add_channel(std::uint16_t schema, const std::string& topic,
                                  const std::string& message_encoding,
                                  const std::map<std::string, std::string>& metadata) {
  const auto id = static_cast<std::uint16_t>(impl_->channel_count + 1U);
  std::string fields;
  put(fields, id);
  put(fields, schema);
  put_string(fields, topic);
  put_string(fields, message_encoding);
  put_map(fields, metadata);
  impl_->append_record(Op::channel, fields);
  put_record(impl_->channels, Op::channel, fields);
  impl_->channel_count = id;
  return id;
}

void Writer::add(const Message& message) {
  if (message.channel == 0 || message.channel > impl_->channel_count) {
    throw std::invalid_argument("a message of a channel that was not added");
  }
  Chunk& open = impl_->open;
  open.places[message.channel].emplace_back(message.log_time, open.records.size());
  open.times.add({message.log_time, message.log_time});
  open.records += static_cast<char>(Op::message);
  put(open.records, std::uint64_t{22 + message.data.size()});
  put(open.records, message.channel);
  put(open.records, message.sequence);
  put(open.records, message.log_time);
  put(open.records, message.publish_time);
  open.records += message.data;
  if (open.records.size() >= impl_->options.chunk_bytes) flush();
}

void Writer::add(const Attachment& attachment) {
  std::string fields;
  put(fields, attachment.log_time);
  put(fields, attachment.create_time);
  put_string(fields, attachment.name);
  put_string(fields, attachment.media_type);
  put(fields, std::uint64_t{attachment.data.size()});
  fields += attachment.data;
  put(fields, crc32(fields));
  const std::uint64_t begin = impl_->offset;
  impl_->append_record(Op::attachment, fields);
  std::string index;
  put(index, begin);
  put(index, impl_->offset - begin);
  put(index, attachment.log_time);
  put(index, attachment.create_time);
  put(index, std::uint64_t{attachment.data.size()});
  put_string(index, attachment.name);
  put_string(index, attachment.media_type);
  put_record(impl_->attachment_indexes, Op::attachment_index, index);
  ++impl_->attachment_count;
}

void Writer::add(const Metadata& metadata) {
  std::string fields;
  put_string(fields, metadata.name);
  put_map(fields, metadata.values);
  const std::uint64_t begin = impl_->offset;
  impl_->append_record(Op::metadata, fields);
  std::string index;
  put(index, begin);
  put(index, impl_->offset - begin);
  put_string(index, metadata.name);
  put_record(impl_->metadata_indexes, Op::metadata_index, index);
  ++impl_->metadata_count;
}

void Writer::flush() {
  if (impl_->open.records.empty()) return;
  const Chunk chunk = std::exchange(impl_->open, {});
  impl_->write(chunk);
  impl_->sink.sync();
}

void Writer::finish() {
  flush();
  impl_->append(impl_->end());
  impl_->sink.sync();
}

std::uint64_t Writer::bytes() const noexcept { return impl_->offset; }
std::uint64_t Writer::written(std::uint16_t channel) const {
  const auto count = impl_->message_counts.find(channel);
  return count == impl_->message_counts.end() ? 0 : count->second;
}
std::size_t Writer::open_bytes() const noexcept { return impl_->open.records.size(); }

}  // namespace dtact::mcap
