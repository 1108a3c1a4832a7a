#pragma once

#include <dds/dds.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace dtact::dds {

/// How long a topic's messages are kept for subscribers that have not confirmed them. All are
/// offered reliably (REP 2003), which best-effort subscribers may take, too; writing never waits
/// for one.
enum class Qos : std::uint8_t {
  sensor,   ///< The newest only.
  command,  ///< The last ten.
  latched   ///< The newest, also for those that come later.
};

/// A node of the ROS 2 graph: "/left" and "dtact" are /left/dtact.
struct Node {
  std::string space;
  std::string name;
  std::vector<dds_guid_t> readers = {};
  std::vector<dds_guid_t> writers = {};
  std::vector<dds_entity_t> entities = {};  ///< Of both.
};

/// A participant of a DDS domain that ROS 2 sees as nodes: names of topics and types, type hashes
/// and ros_discovery_info are those of its middlewares. Throws std::runtime_error naming what
/// failed. Writing is safe from every thread.
class Graph {
 public:
  struct Config {
    std::uint32_t domain = 0;
    std::vector<std::string> interfaces;  ///< Names or addresses. Empty: this machine only.
    std::vector<std::string> peers;       ///< Asked besides those that multicast reaches.
    bool humble = false;                  ///< Node names as up to ROS 2 Humble.
  };

  /// A topic that add_writer() has added.
  struct Published {
    std::string topic;
    const dds_topic_descriptor_t* type;
    Qos qos;
    std::size_t node;
    dds_entity_t writer;
  };

  /// Messages that a writer keeps for each reader.
  [[nodiscard]] static constexpr int depth(Qos kind) { return kind == Qos::command ? 10 : 1; }

  explicit Graph(const Config& config);
  ~Graph();
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;

  /// A node, for the next two functions.
  [[nodiscard]] std::size_t add_node(const std::string& space, const std::string& name);
  /// `topic` as ROS 2 names it: "/left/contact". `type` must outlive this.
  [[nodiscard]] dds_entity_t add_writer(std::size_t node, const std::string& topic,
                                        const dds_topic_descriptor_t& type, Qos qos);
  /// Wakes wait() when messages come.
  [[nodiscard]] dds_entity_t add_reader(std::size_t node, const std::string& topic,
                                        const dds_topic_descriptor_t& type);
  /// Removes all nodes but the first `count`, with their readers and writers.
  void keep_nodes(std::size_t count);
  [[nodiscard]] std::size_t nodes() const noexcept { return nodes_.size(); }
  [[nodiscard]] const std::vector<Published>& published() const noexcept { return published_; }
  /// A set of readers to wait for; see dds_waitset_wait().
  [[nodiscard]] dds_entity_t make_waitset() const;
  /// Messages that a reader of subscribe() keeps: about 16 s of a topic at 60 fps.
  static constexpr std::int32_t kMaxUnread = 1000;
  /// A reader of an own topic, in `waitset`. It keeps messages until they are taken, and rejects
  /// new ones while it has kMaxUnread; see dds_get_sample_rejected_status(). No node owns it.
  [[nodiscard]] dds_entity_t subscribe(const Published& to, dds_entity_t waitset) const;
  /// Tells the others which nodes have which topics. Call it after the last change.
  void announce() const;
  /// Returns when a reader has messages, at the latest after `limit`.
  void wait(std::chrono::milliseconds limit) const;

 private:
  [[nodiscard]] dds_entity_t make_reader(const std::string& name,
                                         const dds_topic_descriptor_t& type, dds_qos_t& qos,
                                         dds_entity_t waitset) const;
  [[nodiscard]] dds_entity_t topic(const std::string& name,
                                   const dds_topic_descriptor_t& type) const;

  bool humble_;
  dds_entity_t domain_ = 0;
  dds_entity_t participant_ = 0;
  dds_entity_t discovery_ = 0;  ///< Writer of ros_discovery_info.
  dds_entity_t readers_ = 0;    ///< A waitset.
  std::vector<Node> nodes_;
  std::vector<Published> published_;
};

/// Loopback and, as participants of this machine may look for others there alone, the machine's
/// other addresses: at most four, which is what Cyclone takes. A Graph without interfaces keeps
/// those that it began with.
[[nodiscard]] std::vector<std::string> own_addresses();
/// Those that network interfaces, by name or address, have at present.
[[nodiscard]] std::vector<std::string> addresses_of(const std::vector<std::string>& interfaces);

/// Whether Config::interfaces has an address: "192.0.2.7", but "eth0.100" is a name.
[[nodiscard]] bool is_address(const std::string& interface);

/// Somebody subscribes to what it writes.
[[nodiscard]] bool has_subscriber(dds_entity_t writer);

}  // namespace dtact::dds
