#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "hal/files/mcap_bytes.hpp"
#include "hal/files/mcap_format.hpp"

namespace dtact::mcap {

/// Where an attachment lies; `name` and times as in Attachment.
struct AttachmentPlace {
  std::uint64_t log_time = 0;
  std::uint64_t create_time = 0;
  std::string name;
  std::string media_type;
  std::uint64_t offset = 0;  ///< position of the record
};

/// Reads an MCAP file of any writer by its summary. Where that is missing, damaged or does not
/// list everything that its statistics count, the reader scans the file; so it can read the file
/// of a killed writer. Holds one chunk in memory. One thread.
class Reader {
 public:
  /// Throws Error when the file is no MCAP, std::system_error when it cannot be read.
  explicit Reader(const std::filesystem::path& path);
  ~Reader();
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  /// Empty when the file is whole; else where it ends or is damaged, and what the latest read()
  /// could not read: the number of chunks and messages, the first with its reason.
  [[nodiscard]] std::string damage() const;
  /// Messages of the latest read() that were earlier than one before them in their channel.
  [[nodiscard]] std::uint64_t out_of_order() const noexcept;
  /// Counts a message that the caller cannot use, until the next read(); damage() names it.
  void count_unreadable(const std::string& why) const;
  [[nodiscard]] const std::map<std::uint16_t, Schema>& schemas() const noexcept;
  [[nodiscard]] const std::map<std::uint16_t, Channel>& channels() const noexcept;
  /// In the order of the file.
  [[nodiscard]] const std::vector<AttachmentPlace>& attachments() const noexcept;
  [[nodiscard]] const std::vector<Metadata>& metadata() const noexcept;

  /// Throws Error.
  [[nodiscard]] Attachment attachment(const AttachmentPlace& place) const;

  /// All messages of these topics in the order of the file (each writer's own; nearly that of their
  /// times), until `take` returns false. What a message views is valid during the call. Damaged
  /// chunks and messages are passed over and counted in damage().
  void read(const std::set<std::string>& topics,
            const std::function<bool(const Channel&, const Message&)>& take) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dtact::mcap
