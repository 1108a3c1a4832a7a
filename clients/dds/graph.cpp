#include "clients/dds/graph.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <memory>
#include <set>
#include <stdexcept>
#include <string_view>

#include "clients/dds/ros2.h"
#include "clients/dds/types.hpp"

namespace dtact::dds {
namespace {

using QosPointer = std::unique_ptr<dds_qos_t, decltype(&dds_delete_qos)>;

dds_entity_t checked(dds_entity_t entity, std::string_view what) {
  if (entity >= 0) return entity;
  throw std::runtime_error(fmt::format("DDS: {}: {}", what, dds_strretcode(entity)));
}

/// On this machine alone nothing is sent by multicast, and messages of up to 64 kB travel in one
/// packet. Over a network a packet is whole in an Ethernet frame, also through WireGuard (1,420
/// bytes): Linux waits 30 s for the rest of a datagram in parts, which fills its 4 MB within a
/// second where 1 % of them is lost, and gives up those that others overtake; then no map arrives
/// any more (tests/MEASURED.md, "ROS 2 graph"). Participants of this machine are asked for by
/// unicast, as some do not listen to multicast.
std::string settings_of(const Graph::Config& config) {
  const bool local = config.interfaces.empty();
  std::string interfaces;
  for (const std::string& one : local ? own_addresses() : config.interfaces) {
    interfaces +=
        fmt::format("<NetworkInterface {}=\"{}\"/>", is_address(one) ? "address" : "name", one);
  }
  std::string peers = "<Peer address=\"127.0.0.1\"/>";
  for (const std::string& one : config.peers) peers += fmt::format("<Peer address=\"{}\"/>", one);
  return fmt::format(
      "<CycloneDDS><Domain><General><Interfaces>{}</Interfaces>{}</General><Discovery>"
      "<Peers>{}</Peers><ParticipantIndex>auto</ParticipantIndex>"
      "<MaxAutoParticipantIndex>100</MaxAutoParticipantIndex>"
      "<SPDPInterval>1 s</SPDPInterval></Discovery>"
      // Several are ended by a packet to the own address, which may be gone by then.
      "<Internal><MultipleReceiveThreads>false</MultipleReceiveThreads></Internal>"
      "</Domain></CycloneDDS>",
      interfaces,
      local ? "<AllowMulticast>false</AllowMulticast><MaxMessageSize>65500B</MaxMessageSize>"
              "<FragmentSize>63000B</FragmentSize>"
            : "<MaxMessageSize>1380B</MaxMessageSize><FragmentSize>1280B</FragmentSize>",
      peers);
}

/// Cyclone receives on all interfaces, whichever it sends through. Lets only packets of this
/// machine reach the sockets of this program that are bound to no address.
void shut_out_the_network() {
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    const int fd = std::atoi(entry.path().filename().c_str());
    sockaddr_in bound{};
    socklen_t size = sizeof bound;
    if (::getsockname(fd, reinterpret_cast<sockaddr*>(&bound), &size) != 0) continue;
    if (bound.sin_family != AF_INET || bound.sin_addr.s_addr != INADDR_ANY) continue;
    // Doing it again needs a privilege.
    std::array<char, IFNAMSIZ> device{};
    size = device.size();
    if (::getsockopt(fd, SOL_SOCKET, SO_BINDTODEVICE, device.data(), &size) == 0 && size > 0) {
      continue;
    }
    if (::setsockopt(fd, SOL_SOCKET, SO_BINDTODEVICE, "lo", 2) != 0) {
      throw std::runtime_error(
          "DDS cannot be kept on this machine: that needs Linux 5.7; give --interface if others "
          "may "
          "subscribe");
    }
  }
}

QosPointer qos_of(Qos kind) {
  QosPointer qos(dds_create_qos(), &dds_delete_qos);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, Graph::depth(kind));
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, 0);
  dds_qset_durability(
      qos.get(), kind == Qos::latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  return qos;
}

/// Since ROS 2 Iron every endpoint says the hash of its type.
void set_type_hash(dds_qos_t& qos, std::string_view type) {
  const auto* known =
      std::ranges::find_if(kTypes, [&](const Type& one) { return type == one.name; });
  if (known == kTypes.end()) return;
  const std::string text = fmt::format("typehash={};", known->hash);
  dds_qset_userdata(&qos, text.data(), text.size());
}

dds_guid_t guid_of(dds_entity_t entity) {
  dds_guid_t guid{};
  checked(dds_get_guid(entity, &guid), "an identity is missing");
  return guid;
}

/// The graph as a message. ROS 2 Humble fills a Gid of 24 bytes up with zeros.
template <typename Info, typename NodeInfo, typename Gid>
void write_graph(dds_entity_t writer, dds_entity_t participant, const std::vector<Node>& nodes) {
  const auto gid = [](const dds_guid_t& guid) {
    Gid made{};
    std::ranges::copy(guid.v, std::begin(made.data));
    return made;
  };
  std::vector<std::vector<Gid>> gids;
  gids.reserve(2 * nodes.size());
  const auto fill = [&](auto& sequence, const std::vector<dds_guid_t>& guids) {
    std::vector<Gid>& made = gids.emplace_back();
    std::ranges::transform(guids, std::back_inserter(made), gid);
    sequence._length = sequence._maximum = static_cast<std::uint32_t>(made.size());
    sequence._buffer = made.data();
  };
  std::vector<NodeInfo> infos(nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    nodes[i].space.copy(infos[i].node_namespace, sizeof infos[i].node_namespace - 1);
    nodes[i].name.copy(infos[i].node_name, sizeof infos[i].node_name - 1);
    fill(infos[i].reader_gid_seq, nodes[i].readers);
    fill(infos[i].writer_gid_seq, nodes[i].writers);
  }
  Info info{};
  info.gid = gid(guid_of(participant));
  info.node_entities_info_seq._length = static_cast<std::uint32_t>(infos.size());
  info.node_entities_info_seq._maximum = info.node_entities_info_seq._length;
  info.node_entities_info_seq._buffer = infos.data();
  checked(dds_write(writer, &info), "the graph cannot be announced");
}

/// Humble's message under the name that it has there.
dds_topic_descriptor_t humble_graph() {
  const dds_topic_descriptor_t& made = rmw_dds_common_humble_msg_dds__ParticipantEntitiesInfo__desc;
  return {made.m_size,
          made.m_align,
          made.m_flagset,
          made.m_nkeys,
          rmw_dds_common_msg_dds__ParticipantEntitiesInfo__desc.m_typename,
          made.m_keys,
          made.m_nops,
          made.m_ops,
          made.m_meta,
          made.type_information,
          made.type_mapping,
          made.restrict_data_representation};
}

}  // namespace

bool is_address(const std::string& interface) {
  in6_addr ignored{};  // large enough for both
  return ::inet_pton(AF_INET, interface.c_str(), &ignored) == 1 ||
         ::inet_pton(AF_INET6, interface.c_str(), &ignored) == 1;
}

namespace {

/// An address of a network interface of this machine.
struct InterfaceAddress {
  std::string interface;
  std::string address;
  unsigned flags;
};

/// In the kernel's order; none where they cannot be had.
std::vector<InterfaceAddress> interface_addresses() {
  std::vector<InterfaceAddress> all;
  ifaddrs* list = nullptr;
  if (::getifaddrs(&list) != 0) return all;
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> owner(list, &::freeifaddrs);
  for (const ifaddrs* one = list; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    std::array<char, INET_ADDRSTRLEN> text{};
    const auto* address = reinterpret_cast<const sockaddr_in*>(one->ifa_addr);
    ::inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size());
    all.push_back({one->ifa_name, text.data(), one->ifa_flags});
  }
  return all;
}

}  // namespace

std::vector<std::string> own_addresses() {
  std::vector<std::string> addresses{"127.0.0.1"};
  std::set<std::string> interfaces;
  for (const InterfaceAddress& one : interface_addresses()) {
    if ((one.flags & IFF_UP) == 0 || (one.flags & IFF_LOOPBACK) != 0) continue;
    if (addresses.size() < 4 && interfaces.insert(one.interface).second)
      addresses.push_back(one.address);
  }
  return addresses;
}

std::vector<std::string> addresses_of(const std::vector<std::string>& interfaces) {
  std::vector<std::string> addresses;
  for (const InterfaceAddress& one : interface_addresses()) {
    const bool named = std::ranges::count(interfaces, one.interface) > 0 ||
                       std::ranges::count(interfaces, one.address) > 0;
    if (named && (one.flags & IFF_UP) != 0) addresses.push_back(one.address);
  }
  return addresses;
}

Graph::Graph(const Config& config) : humble_(config.humble) {
  domain_ = dds_create_domain(config.domain, settings_of(config).c_str());
  if (domain_ < 0) {
    throw std::runtime_error(fmt::format(
        "DDS: domain {} cannot be opened on {}: {}. Does the interface exist and have an address "
        "(ip address)? A domain is 0 to 232",
        config.domain,
        config.interfaces.empty() ? "this machine"
                                  : fmt::format("{}", fmt::join(config.interfaces, ", ")),
        dds_strretcode(domain_)));
  }
  // Both make sockets.
  if (config.interfaces.empty()) shut_out_the_network();
  const QosPointer qos(dds_create_qos(), &dds_delete_qos);
  constexpr std::string_view kEnclave = "enclave=/;";
  dds_qset_userdata(qos.get(), kEnclave.data(), kEnclave.size());
  participant_ =
      checked(dds_create_participant(config.domain, qos.get(), nullptr), "no participant");
  if (config.interfaces.empty()) shut_out_the_network();
  static const dds_topic_descriptor_t kHumble = humble_graph();
  const dds_topic_descriptor_t& type =
      humble_ ? kHumble : rmw_dds_common_msg_dds__ParticipantEntitiesInfo__desc;
  const QosPointer latched = qos_of(Qos::latched);
  if (!humble_) set_type_hash(*latched, type.m_typename);
  discovery_ = checked(
      dds_create_writer(participant_, topic("ros_discovery_info", type), latched.get(), nullptr),
      "no writer of ros_discovery_info");
  readers_ = make_waitset();
  // A set of nothing is not waited for at all, and without commands there is no reader.
  checked(dds_waitset_attach(readers_,
                             checked(dds_create_guardcondition(participant_), "no condition"), 0),
          "no condition");
}

Graph::~Graph() { dds_delete(domain_); }

std::size_t Graph::add_node(const std::string& space, const std::string& name) {
  nodes_.push_back({space, name});
  return nodes_.size() - 1;
}

dds_entity_t Graph::topic(const std::string& name, const dds_topic_descriptor_t& type) const {
  return checked(dds_create_topic(participant_, &type, name.c_str(), nullptr, nullptr), name);
}

dds_entity_t Graph::add_writer(std::size_t node, const std::string& name,
                               const dds_topic_descriptor_t& type, Qos kind) {
  const QosPointer qos = qos_of(kind);
  if (!humble_) set_type_hash(*qos, type.m_typename);
  const dds_entity_t writer =
      checked(dds_create_writer(participant_, topic("rt" + name, type), qos.get(), nullptr), name);
  nodes_[node].entities.push_back(writer);
  nodes_[node].writers.push_back(guid_of(writer));
  published_.push_back({name, &type, kind, node, writer});
  return writer;
}

dds_entity_t Graph::add_reader(std::size_t node, const std::string& name,
                               const dds_topic_descriptor_t& type) {
  const QosPointer qos = qos_of(Qos::command);
  const dds_entity_t reader = make_reader(name, type, *qos, readers_);
  nodes_[node].entities.push_back(reader);
  nodes_[node].readers.push_back(guid_of(reader));
  return reader;
}

void Graph::keep_nodes(std::size_t count) {
  for (; nodes_.size() > count; nodes_.pop_back()) {
    for (const dds_entity_t entity : nodes_.back().entities) {
      const dds_entity_t topic = dds_get_topic(entity);
      dds_delete(entity);
      dds_delete(topic);
    }
  }
  std::erase_if(published_, [&](const Published& one) { return one.node >= count; });
}

dds_entity_t Graph::make_reader(const std::string& name, const dds_topic_descriptor_t& type,
                                dds_qos_t& qos, dds_entity_t waitset) const {
  if (!humble_) set_type_hash(qos, type.m_typename);
  const dds_entity_t reader =
      checked(dds_create_reader(participant_, topic("rt" + name, type), &qos, nullptr), name);
  checked(dds_set_status_mask(reader, DDS_DATA_AVAILABLE_STATUS), name);
  checked(dds_waitset_attach(waitset, reader, reader), name);
  return reader;
}

dds_entity_t Graph::make_waitset() const {
  return checked(dds_create_waitset(participant_), "no waitset");
}

dds_entity_t Graph::subscribe(const Published& to, dds_entity_t waitset) const {
  const QosPointer qos = qos_of(to.qos);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_ALL, DDS_LENGTH_UNLIMITED);
  dds_qset_resource_limits(qos.get(), kMaxUnread, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  return make_reader(to.topic, *to.type, *qos, waitset);
}

void Graph::announce() const {
  if (humble_) {
    write_graph<rmw_dds_common_humble_msg_dds__ParticipantEntitiesInfo_,
                rmw_dds_common_humble_msg_dds__NodeEntitiesInfo_,
                rmw_dds_common_humble_msg_dds__Gid_>(discovery_, participant_, nodes_);
  } else {
    write_graph<rmw_dds_common_msg_dds__ParticipantEntitiesInfo_,
                rmw_dds_common_msg_dds__NodeEntitiesInfo_, rmw_dds_common_msg_dds__Gid_>(
        discovery_, participant_, nodes_);
  }
}

void Graph::wait(std::chrono::milliseconds limit) const {
  checked(dds_waitset_wait(readers_, nullptr, 0, DDS_MSECS(limit.count())), "waiting");
}

bool has_subscriber(dds_entity_t writer) {
  dds_publication_matched_status_t status{};
  return dds_get_publication_matched_status(writer, &status) == DDS_RETCODE_OK &&
         status.current_count > 0;
}

}  // namespace dtact::dds
