#include "hal/files/mcap_record_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <cerrno>
#include <memory>
#include <system_error>

namespace dtact::mcap {
namespace {

/// The bytes of a zstd stream, which must be `size`. Grows as they come: what is announced costs
/// nothing.
std::string decompress(std::string_view bytes, std::uint64_t size, const Cursor& where) {
  constexpr std::size_t kStep = std::size_t{1} << 20U;
  const std::unique_ptr<ZSTD_DCtx, std::size_t (*)(ZSTD_DCtx*)> context(ZSTD_createDCtx(),
                                                                        ZSTD_freeDCtx);
  std::string out;
  ZSTD_inBuffer in{bytes.data(), bytes.size(), 0};
  for (;;) {
    const std::size_t begin = out.size();
    out.resize(static_cast<std::size_t>(std::min<std::uint64_t>(size, begin + kStep)));
    ZSTD_outBuffer buffer{out.data(), out.size(), begin};
    const std::size_t left = ZSTD_decompressStream(context.get(), &buffer, &in);
    if (ZSTD_isError(left) != 0U) {
      where.fail(fmt::format("a chunk does not decompress: {}", ZSTD_getErrorName(left)));
    }
    const bool stuck = buffer.pos == begin && in.pos == in.size;
    out.resize(buffer.pos);
    if (in.pos == in.size && (left == 0 || stuck || out.size() == size)) break;
    if (out.size() == size && buffer.pos == begin) break;
  }
  if (out.size() != size || in.pos != in.size) {
    where.fail(fmt::format("a chunk announces {} bytes and holds {}", size, out.size()));
  }
  return out;
}

}  // namespace

RecordFile::RecordFile(const std::filesystem::path& path)
    : name_(path.string()), fd_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  struct stat status{};
  if (!fd_ || ::fstat(fd_.get(), &status) != 0) {
    throw std::system_error(errno, std::generic_category(), name_);
  }
  size_ = status.st_size > 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

void RecordFile::fail(std::uint64_t offset, std::string_view what) const {
  cursor({}, offset).fail(what);
}

std::string RecordFile::load(std::uint64_t offset, std::uint64_t length) const {
  if (offset > size_ || length > size_ - offset) {
    fail(offset, fmt::format("{} bytes are announced, the file ends at {}", length, size_));
  }
  if (length > kMaxRecord) {
    fail(offset, fmt::format("a record of {} bytes, at most {} are read", length, kMaxRecord));
  }
  std::string bytes(static_cast<std::size_t>(length), '\0');
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got = ::pread(fd_.get(), bytes.data() + done, bytes.size() - done,
                                static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw std::system_error(errno, std::generic_category(), name_);
    if (got == 0) fail(offset + done, "the file became shorter");
    done += static_cast<std::size_t>(got);
  }
  return bytes;
}

std::string RecordFile::load_record(std::uint64_t offset, Op expected) const {
  const std::string head = load(offset, kRecordHead);
  Cursor fields = cursor(head, offset);
  if (static_cast<Op>(fields.take<std::uint8_t>()) != expected) {
    fail(offset, "here should be a record of another kind");
  }
  return load(offset + kRecordHead, fields.take<std::uint64_t>());
}

std::string RecordFile::load_chunk(std::uint64_t offset) const {
  const std::string record = load_record(offset, Op::chunk);
  Cursor fields = cursor(record, offset + kRecordHead);
  (void)fields.bytes(16);  // first and last time
  const auto length = fields.take<std::uint64_t>();
  const auto expected = fields.take<std::uint32_t>();
  const std::string compression = fields.string();
  const std::string_view bytes = fields.bytes(fields.take<std::uint64_t>());
  if (length > kMaxRecord) {
    fields.fail(fmt::format("a chunk of {} bytes, at most {} are read", length, kMaxRecord));
  }
  std::string records;
  if (compression == "zstd") {
    records = decompress(bytes, length, fields);
  } else if (compression.empty()) {
    if (bytes.size() != length) fields.fail("a chunk's two sizes differ");
    records = bytes;
  } else {
    fields.fail(
        fmt::format("a chunk is compressed by \"{}\": only zstd is read; `mcap compress "
                    "--compression zstd` makes it so",
                    compression.substr(0, 16)));
  }
  if (expected != 0 && crc32(records) != expected) fields.fail("a chunk's CRC is wrong");
  return records;
}

}  // namespace dtact::mcap
