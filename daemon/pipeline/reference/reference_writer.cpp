#include "daemon/pipeline/reference/reference_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <exception>
#include <system_error>
#include <utility>

namespace dtact::pipeline {

ReferenceWriter::ReferenceWriter(int width, int height, std::filesystem::path folder,
                                 base::BackgroundThread& thread)
    : folder_(std::move(folder)), write_(thread, [this] { write(); }) {
  pending_.width = width;
  pending_.height = height;
  pending_.image_q8.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
}

bool ReferenceWriter::offer(std::span<const std::uint16_t> reference_q8, const hal::Light& light,
                            std::shared_ptr<const calibration::Calibration> calibration) noexcept {
  if (folder_.empty()) return true;
  if (write_.busy()) return false;
  std::ranges::copy(reference_q8, pending_.image_q8.begin());
  pending_.light = light;
  calibration_ = std::move(calibration);
  write_.hand_over();
  return true;
}

std::string ReferenceWriter::message() const {
  const std::scoped_lock lock(mutex_);
  return message_;
}

void ReferenceWriter::write() {
  std::string failure;
  try {
    save_reference(pending_, *calibration_, folder_);
    has_written_.store(true, std::memory_order_relaxed);
  } catch (const std::system_error& e) {
    const bool full = e.code() == std::errc::no_space_on_device || e.code().value() == EDQUOT;
    failure = fmt::format("the last good reference is not kept ({}): {}", e.what(),
                          full ? "free some space there" : "make the state folder writable");
  } catch (const std::exception& e) {
    failure = fmt::format("the last good reference is not kept ({})", e.what());
  }
  calibration_.reset();
  const std::scoped_lock lock(mutex_);
  message_ = std::move(failure);
}

}  // namespace dtact::pipeline
