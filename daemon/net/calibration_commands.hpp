#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "daemon/net/calibration_store.hpp"
#include "daemon/net/request.hpp"
#include "daemon/pipeline/port.hpp"
#include "daemon/serve/net_config.hpp"

namespace dtact::v1 {
class ActivateCalibration;
class GetCalibration;
class PinCalibration;
class SetReconstruction;
class UploadCalibration;
}  // namespace dtact::v1

namespace dtact::net {

class Hub;

/// The requests that read, list and change calibrations, change how depth is made of them, or read
/// the reference. All on the network thread; what takes longer than a frame is done on the worker:
/// reading, writing and packing files, and preparing a calibration for the pipeline.
class CalibrationCommands : public std::enable_shared_from_this<CalibrationCommands> {
 public:
  CalibrationCommands(boost::asio::io_context& io, boost::asio::thread_pool& worker,
                      const NetConfig& config, Hub& hub, pipeline::Port& port,
                      CalibrationStore& store);

  void get(const Requester& requester, const v1::GetCalibration& request);
  void list(const Requester& requester);
  void upload(const Requester& requester, const v1::UploadCalibration& request);
  void activate(const Requester& requester, const v1::ActivateCalibration& request);
  void pin(const Requester& requester, const v1::PinCalibration& request);
  void get_reference(const Requester& requester);
  void set_reconstruction(const Requester& requester, const v1::SetReconstruction& request);

 private:
  /// An upload, or without one the activation of a number.
  struct Change {
    std::shared_ptr<const CalibrationFiles> upload = {};
    std::uint64_t number = 0;
    std::string name = {};    ///< Once it was read.
    std::uint64_t key = 0;    ///< The pipeline's, once it was read.
    pipeline::Stamp at = {};  ///< When the pipeline began to use it.
  };

  /// Reads, checks and prepares on the worker; then the pipeline uses it, then keep().
  void change(const Requester& requester, Change change);
  /// The pipeline uses the calibration: keeps it, reports and answers that.
  void keep(const Requester& requester, const Change& change);
  void send_reference(const Requester& requester,
                      const std::shared_ptr<const pipeline::ReferenceCopy>& reference);
  void report(const Change& change, std::optional<std::uint64_t> number);
  /// Queues `work` for the worker; `done`(*this, its result) runs here afterwards.
  template <typename Work, typename Done>
  void on_worker(Work work, Done done) {
    waiting_.push_back(job(std::move(work), std::move(done)));
    next_job();
  }
  /// The same before all readers, in the order of the calls: for what changes something.
  template <typename Work, typename Done>
  void first_on_worker(Work work, Done done) {
    changes_.push_back(job(std::move(work), std::move(done)));
    next_job();
  }
  template <typename Work, typename Done>
  [[nodiscard]] std::function<void()> job(Work work, Done done);
  /// Gives the worker the next job unless it has one.
  void next_job();

  boost::asio::io_context& io_;
  boost::asio::thread_pool& worker_;
  const NetConfig& config_;
  Hub& hub_;
  pipeline::Port& port_;
  CalibrationStore& store_;
  /// Number of the calibration in use; nothing when there is none, it has no number or
  /// the store failed to keep it.
  std::optional<std::uint64_t> in_use_;
  /// A calibration or the reconstruction. One at a time: an upload may be as large as a message,
  /// and what the worker prepares for the one must fit the other.
  bool changing_ = false;
  std::uint64_t last_key_ = 0;  ///< The pipeline's key of the newest calibration.
  int reading_ = 0;             ///< Requests on the worker that change nothing in the pipeline.
  std::deque<std::function<void()>> changes_;  ///< Jobs for the worker that go first.
  std::deque<std::function<void()>> waiting_;  ///< Its other jobs.
  bool working_ = false;
};

}  // namespace dtact::net
