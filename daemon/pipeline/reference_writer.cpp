#include "daemon/pipeline/reference_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <utility>

namespace dtact::pipeline {

ReferenceWriter::ReferenceWriter(int width, int height, std::filesystem::path folder)
    : folder_(std::move(folder)) {
  pending_.width = width;
  pending_.height = height;
  pending_.image_q8.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
}

void ReferenceWriter::start() {
  stop_ = false;
  thread_ = base::RtThread({.name = "dtact-store", .cpu = {}}, [this] { run(); });
}

void ReferenceWriter::stop() noexcept {
  stop_ = true;
  work_.ring();
  thread_.join();
}

bool ReferenceWriter::offer(std::span<const std::uint16_t> reference_q8, const hal::Light& light,
                            std::shared_ptr<const calibration::Calibration> calibration) noexcept {
  if (folder_.empty()) return true;
  if (full_.load(std::memory_order_acquire)) return false;
  std::ranges::copy(reference_q8, pending_.image_q8.begin());
  pending_.light = light;
  calibration_ = std::move(calibration);
  full_.store(true, std::memory_order_release);
  work_.ring();
  return true;
}

std::string ReferenceWriter::message() const {
  const std::scoped_lock lock(mutex_);
  return message_;
}

void ReferenceWriter::run() {
  for (;;) {
    work_.wait();
    if (full_.load(std::memory_order_acquire)) {
      std::string failure;
      try {
        save_reference(pending_, *calibration_, folder_);
      } catch (const std::exception& e) {
        failure = fmt::format(
            "the last good reference is not kept ({}): make the state folder writable", e.what());
      }
      calibration_.reset();
      {
        const std::scoped_lock lock(mutex_);
        message_ = std::move(failure);
      }
      full_.store(false, std::memory_order_release);
    }
    if (stop_) return;
  }
}

}  // namespace dtact::pipeline
