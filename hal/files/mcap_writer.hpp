#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "hal/files/mcap_file_sink.hpp"
#include "hal/files/mcap_format.hpp"

namespace dtact::mcap {

struct WriterOptions {
  std::string library = "dtact";        ///< Who wrote the file.
  std::string profile{};                ///< Names what readers may expect of it: "ros2".
  std::size_t chunk_bytes = 4U << 20U;  ///< An open chunk this large is written.
  int level = 1;                        ///< zstd's.
};

/// Writes an MCAP file: schemas, channels, attachments and metadata at once, messages in chunks,
/// each compressed by zstd, indexed, appended in one piece and synced. At any moment the file can
/// be read but for the messages of the open chunk. finish() adds the index of it all.
///
/// What the sink throws comes out. The chunk that it refused is lost then, the file ends before it,
/// and finish() may still succeed: the summary is small. One thread.
class Writer {
 public:
  explicit Writer(Sink& sink, const WriterOptions& options = {});
  ~Writer();
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  /// Returns its id. Schema 0 means that a channel has none.
  [[nodiscard]] std::uint16_t add_schema(const std::string& name, const std::string& encoding,
                                         const std::string& data);
  [[nodiscard]] std::uint16_t add_channel(std::uint16_t schema, const std::string& topic,
                                          const std::string& message_encoding,
                                          const std::map<std::string, std::string>& metadata = {});
  /// Adds a message of a channel added before.
  void add(const Message& message);
  void add(const Attachment& attachment);
  void add(const Metadata& metadata);

  /// Writes the open chunk, if it holds anything.
  void flush();
  /// The open chunk, the index and the end. Nothing may be added then.
  void finish();

  /// Size of the file so far, without the open chunk.
  [[nodiscard]] std::uint64_t bytes() const noexcept;
  /// Messages of a channel that the file holds so far, without those of the open chunk.
  [[nodiscard]] std::uint64_t written(std::uint16_t channel) const;
  /// Size of the open chunk, before compression.
  [[nodiscard]] std::size_t open_bytes() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dtact::mcap
