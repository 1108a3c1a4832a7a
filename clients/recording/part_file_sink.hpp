#pragma once

#include <string>
#include <string_view>

#include "hal/base/unique_fd.hpp"
#include "hal/files/mcap_file_sink.hpp"

namespace dtact::recording {

/// A file that is called FILE.part until give_name(): an earlier recording stays until then. What
/// is no regular file, as a pipe, is written straight to.
class PartFileSink final : public mcap::Sink {
 public:
  /// Throws std::runtime_error where the file exists and `replace` is false, and where another
  /// program writes FILE.part. One that a killed program left is emptied.
  PartFileSink(const std::string& file, bool replace);
  /// Removes a file that was given no name.
  ~PartFileSink() override;
  PartFileSink(const PartFileSink&) = delete;
  PartFileSink& operator=(const PartFileSink&) = delete;

  void append(std::string_view bytes) override { sink_.append(bytes); }
  void sync() override { sink_.sync(); }
  /// Throws std::runtime_error, also where another file has taken the name since. May be called
  /// beside append().
  void give_name();

 private:
  std::string file_;
  bool replace_;
  std::string part_;     ///< Empty once it has its name.
  base::UniqueFd lock_;  ///< Of the part: it ends with the program, however that ends.
  mcap::FileSink sink_;
};

}  // namespace dtact::recording
