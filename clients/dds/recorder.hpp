#pragma once

#include <dds/dds.h>

#include <atomic>
#include <cstdint>
#include <exception>
#include <map>
#include <string>
#include <thread>

#include "clients/dds/graph.hpp"
#include "clients/recording/part_file_sink.hpp"
#include "hal/files/mcap_writer.hpp"

namespace dtact::dds {

/// Subscribes to all that a graph publishes, as a node would, and writes it as rosbag2 does: an
/// MCAP file of serialized messages with their definitions, which `ros2 bag` and Foxglove read. On
/// a thread of its own.
class Recorder {
 public:
  /// Of the topics that `graph` has by now. `replace`: a file of that name is replaced once a
  /// sensor's message has come; else it is an error. `graph` must outlive this.
  Recorder(Graph& graph, const std::string& file, bool replace);
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  /// The file could not be written; finish() throws why.
  [[nodiscard]] bool failed() const noexcept { return failed_; }
  /// Closes the file, also after a failure, and returns the number of messages. Without one of a
  /// sensor the file is removed, and it throws.
  std::uint64_t finish();
  /// Messages that came while Graph::kMaxUnread of their topic waited for the disk. After finish().
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }

 private:
  void run();
  struct Channel {
    std::uint16_t id;
    bool of_sensor;                ///< Not one that the bridge fills without a sensor.
    dds_instance_handle_t writer;  ///< Others may publish on the topic, too.
  };
  void take(dds_entity_t reader, const Channel& channel);

  recording::PartFileSink sink_;
  mcap::Writer writer_;
  dds_entity_t waitset_;
  std::map<dds_entity_t, Channel> channels_;  ///< By reader.
  std::string buffer_;
  std::uint64_t messages_ = 0;
  bool named_ = false;  ///< A sensor's message has come.
  std::uint64_t lost_ = 0;
  std::atomic<bool> ending_ = false;
  std::atomic<bool> failed_ = false;
  std::exception_ptr failure_;  ///< Of the thread, until it has ended.
  std::thread thread_;
};

}  // namespace dtact::dds
