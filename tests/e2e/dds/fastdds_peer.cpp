// A program of another DDS, Fast DDS, on the same domain: it knows no types and passes payloads on
// as they come. fastdds_peer DOMAIN reads commands from standard input, a line each:
//
//   subscribe TOPIC TYPE sensor|reliable|latched [BYTES]   at most BYTES of each sample are printed
//   unsubscribe TOPIC
//   publish TOPIC TYPE HEX          a sample, reliable; a new writer waits 2 s for a reader
//   participants COUNT              further ones until the program ends
//
// and prints, a line each, blanks between the words:
//
//   sample TOPIC RECEIVED_NS HEX    RECEIVED_NS: CLOCK_REALTIME
//   writer TOPIC TYPE GUID USERDATA and reader TOPIC TYPE GUID USERDATA: an endpoint was discovered
//   participant GUID USERDATA
//   gone GUID                       a participant
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <iostream>
#include <map>
#include <mutex>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

namespace {

// Debian 12 has Fast DDS 2.9, Debian 13 3.1, whose interfaces have other names.
#if __has_include(<fastdds/config.hpp>)
#define DTACT_FASTDDS_3
#endif

using namespace eprosima::fastdds::dds;
#ifdef DTACT_FASTDDS_3
namespace rtps = eprosima::fastdds::rtps;
#else
namespace rtps = eprosima::fastrtps::rtps;
constexpr auto RETCODE_OK = ReturnCode_t::RETCODE_OK;
#endif
using Bytes = std::vector<unsigned char>;

std::mutex output;

void print(const std::string& line) {
  const std::lock_guard<std::mutex> lock(output);
  std::cout << line << '\n' << std::flush;
}

std::string hex(const unsigned char* bytes, std::size_t count) {
  static const char* const kDigits = "0123456789abcdef";
  std::string text;
  text.reserve(2 * count);
  for (std::size_t i = 0; i < count; ++i) {
    text += kDigits[bytes[i] >> 4];
    text += kDigits[bytes[i] & 15];
  }
  return text;
}

Bytes from_hex(const std::string& text) {
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
    bytes.push_back(static_cast<unsigned char>(std::stoi(text.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

/// Any type: its samples are serialized payloads.
class AnyType : public TopicDataType {
 public:
  explicit AnyType(const std::string& name) {
    constexpr std::uint32_t kMaxBytes = 4U << 20U;
#ifdef DTACT_FASTDDS_3
    set_name(name);
    max_serialized_type_size = kMaxBytes;
#else
    setName(name.c_str());
    m_typeSize = kMaxBytes;
#endif
  }

#ifdef DTACT_FASTDDS_3
  bool serialize(const void* data, rtps::SerializedPayload_t& to, DataRepresentationId_t) override {
    return put(data, to);
  }
  bool deserialize(rtps::SerializedPayload_t& from, void* data) override {
    return take(from, data);
  }
  std::uint32_t calculate_serialized_size(const void* data, DataRepresentationId_t) override {
    return size_of(data);
  }
  void* create_data() override { return new Bytes; }
  void delete_data(void* data) override { delete static_cast<Bytes*>(data); }
  bool compute_key(rtps::SerializedPayload_t&, rtps::InstanceHandle_t&, bool) override {
    return false;
  }
  bool compute_key(const void*, rtps::InstanceHandle_t&, bool) override { return false; }
#else
  bool serialize(void* data, rtps::SerializedPayload_t* to) override { return put(data, *to); }
  bool deserialize(rtps::SerializedPayload_t* from, void* data) override {
    return take(*from, data);
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return size_of(data); };
  }
  void* createData() override { return new Bytes; }
  void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
#endif

 private:
  static bool put(const void* data, rtps::SerializedPayload_t& to) {
    const Bytes& bytes = *static_cast<const Bytes*>(data);
    std::memcpy(to.data, bytes.data(), bytes.size());
    to.length = static_cast<std::uint32_t>(bytes.size());
    return true;
  }
  static bool take(const rtps::SerializedPayload_t& from, void* data) {
    static_cast<Bytes*>(data)->assign(from.data, from.data + from.length);
    return true;
  }
  static std::uint32_t size_of(const void* data) {
    return static_cast<std::uint32_t>(static_cast<const Bytes*>(data)->size());
  }
};

std::string guid(const rtps::GUID_t& id) {
  return hex(id.guidPrefix.value, 12) + hex(id.entityId.value, 4);
}

class Discovery : public DomainParticipantListener {
#ifdef DTACT_FASTDDS_3
  using Status = rtps::ParticipantDiscoveryStatus;
  void on_participant_discovery(DomainParticipant*, Status status,
                                const rtps::ParticipantBuiltinTopicData& found, bool&) override {
    participant(status == Status::DISCOVERED_PARTICIPANT, status == Status::CHANGED_QOS_PARTICIPANT,
                found.guid, found.user_data);
  }
  void on_data_writer_discovery(DomainParticipant*, rtps::WriterDiscoveryStatus status,
                                const PublicationBuiltinTopicData& found, bool&) override {
    if (status != rtps::WriterDiscoveryStatus::DISCOVERED_WRITER) return;
    endpoint("writer", found.topic_name, found.type_name, found.guid, found.user_data);
  }
  void on_data_reader_discovery(DomainParticipant*, rtps::ReaderDiscoveryStatus status,
                                const SubscriptionBuiltinTopicData& found, bool&) override {
    if (status != rtps::ReaderDiscoveryStatus::DISCOVERED_READER) return;
    endpoint("reader", found.topic_name, found.type_name, found.guid, found.user_data);
  }
#else
  void on_participant_discovery(DomainParticipant*,
                                rtps::ParticipantDiscoveryInfo&& found) override {
    using Info = rtps::ParticipantDiscoveryInfo;
    participant(found.status == Info::DISCOVERED_PARTICIPANT,
                found.status == Info::CHANGED_QOS_PARTICIPANT, found.info.m_guid,
                found.info.m_userData);
  }
  void on_publisher_discovery(DomainParticipant*, rtps::WriterDiscoveryInfo&& found) override {
    if (found.status != rtps::WriterDiscoveryInfo::DISCOVERED_WRITER) return;
    endpoint("writer", found.info.topicName(), found.info.typeName(), found.info.guid(),
             found.info.m_qos.m_userData);
  }
  void on_subscriber_discovery(DomainParticipant*, rtps::ReaderDiscoveryInfo&& found) override {
    if (found.status != rtps::ReaderDiscoveryInfo::DISCOVERED_READER) return;
    endpoint("reader", found.info.topicName(), found.info.typeName(), found.info.guid(),
             found.info.m_qos.m_userData);
  }
#endif
  template <typename Data>
  static void participant(bool discovered, bool changed, const rtps::GUID_t& id, const Data& data) {
    if (discovered) {
      print("participant " + guid(id) + " " + std::string(data.begin(), data.end()));
    } else if (!changed) {
      print("gone " + guid(id));
    }
  }
  template <typename Name, typename Data>
  static void endpoint(const char* kind, const Name& topic, const Name& type,
                       const rtps::GUID_t& id, const Data& data) {
    std::ostringstream line;
    line << kind << ' ' << topic << ' ' << type << ' ' << guid(id) << ' '
         << std::string(data.begin(), data.end());
    print(line.str());
  }
};

class Samples : public DataReaderListener {
 public:
  explicit Samples(std::size_t max_bytes) : max_bytes_(max_bytes) {}

 private:
  void on_data_available(DataReader* reader) override {
    Bytes bytes;
    SampleInfo info;
    while (reader->take_next_sample(&bytes, &info) == RETCODE_OK) {
      // Over a lossy network Fast DDS also passes on samples of no bytes.
      if (!info.valid_data || bytes.empty()) continue;
      const auto now = std::chrono::system_clock::now().time_since_epoch();
      print("sample " + reader->get_topicdescription()->get_name() + " " +
            std::to_string(std::chrono::nanoseconds(now).count()) + " " +
            hex(bytes.data(), std::min(max_bytes_, bytes.size())));
    }
  }

  std::size_t max_bytes_;
};

class Peer {
 public:
  explicit Peer(std::uint32_t domain) : domain_(domain) {
    DomainParticipantQos qos;
    DomainParticipantFactory::get_instance()->get_default_participant_qos(qos);
    participant_ = DomainParticipantFactory::get_instance()->create_participant(
        domain, qos, &discovery_, StatusMask::none());
    publisher_ = participant_->create_publisher(PUBLISHER_QOS_DEFAULT);
    subscriber_ = participant_->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  }

  ~Peer() {
    participant_->delete_contained_entities();
    DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }

  void obey(const std::string& line) {
    std::istringstream words(line);
    std::string verb, topic, type, rest;
    std::size_t max_bytes = SIZE_MAX;
    words >> verb >> topic >> type >> rest;
    if (!(words >> max_bytes)) max_bytes = SIZE_MAX;
    if (verb == "subscribe") {
      DataReaderQos qos = DATAREADER_QOS_DEFAULT;
      qos.reliability().kind =
          rest == "sensor" ? BEST_EFFORT_RELIABILITY_QOS : RELIABLE_RELIABILITY_QOS;
      if (rest == "latched") qos.durability().kind = TRANSIENT_LOCAL_DURABILITY_QOS;
      qos.history().depth = 10;
      qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
      readers_[topic] = subscriber_->create_datareader(
          topic_of(topic, type), qos, &samples_.try_emplace(topic, max_bytes).first->second);
    } else if (verb == "unsubscribe") {
      subscriber_->delete_datareader(readers_.at(topic));
      readers_.erase(topic);
    } else if (verb == "publish") {
      DataWriter*& writer = writers_[topic + type];
      if (writer == nullptr) {
        DataWriterQos qos = DATAWRITER_QOS_DEFAULT;
        qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
        writer = publisher_->create_datawriter(topic_of(topic, type), qos);
        // A reader that comes later does not get what was written before.
        PublicationMatchedStatus matched;
        for (int i = 0; i < 40 && matched.current_count == 0; ++i) {
          std::this_thread::sleep_for(std::chrono::milliseconds(50));
          writer->get_publication_matched_status(matched);
        }
      }
      Bytes bytes = from_hex(rest);
      if (writer != nullptr) writer->write(&bytes);
    } else if (verb == "participants") {
      for (int i = std::stoi(topic); i > 0; --i) {
        DomainParticipantFactory::get_instance()->create_participant(domain_,
                                                                     PARTICIPANT_QOS_DEFAULT);
      }
    } else {
      print("unknown " + line);
    }
  }

 private:
  Topic* topic_of(const std::string& name, const std::string& type) {
    Topic*& topic = topics_[name];
    if (topic == nullptr) {
      TypeSupport(new AnyType(type)).register_type(participant_);
      topic = participant_->create_topic(name, type, TOPIC_QOS_DEFAULT);
    }
    return topic;
  }

  std::uint32_t domain_;
  Discovery discovery_;
  std::map<std::string, Samples> samples_;
  DomainParticipant* participant_ = nullptr;
  Publisher* publisher_ = nullptr;
  Subscriber* subscriber_ = nullptr;
  std::map<std::string, Topic*> topics_;
  std::map<std::string, DataReader*> readers_;
  std::map<std::string, DataWriter*> writers_;
};

}  // namespace

int main(int, char** arguments) {
  Peer peer(static_cast<std::uint32_t>(std::stoul(arguments[1])));
  std::string line;
  while (std::getline(std::cin, line)) peer.obey(line);
}
