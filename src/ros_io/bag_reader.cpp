#include "fringe_fusion/ros_io/bag_reader.hpp"

#include <fringe_fusion/Frame.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2/buffer_core.h>
#include <tf2/exceptions.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "fringe_fusion/ros_io/cloud_messages.hpp"
#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/pattern_messages.hpp"

namespace fringe_fusion::ros_io {
namespace {

// tf forgets what is older than its cache; a bag is read as a whole, however long it is.
constexpr double kTfCacheSeconds = 1e9;
constexpr std::uint32_t kMaxFrames = 10000;

bool EndsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// Frames of a view until it is complete.
struct PartialStack {
  std::vector<std::optional<CapturedFrame>> frames;
  std::vector<Pattern> patterns;
  std::size_t num_present = 0;
  int projector_width = 0;
  int projector_height = 0;
  std::string camera_frame;
};

Status AddFrame(PartialStack& partial, const Frame& message) {
  if (message.num_frames == 0 || message.num_frames > kMaxFrames ||
      message.index >= message.num_frames) {
    return Fail("frame {} of {}: index must lie below a count of 1 .. {}", message.index,
                message.num_frames, kMaxFrames);
  }
  if (partial.frames.empty()) {
    partial.frames.resize(message.num_frames);
    partial.patterns.resize(message.num_frames);
    partial.projector_width = static_cast<int>(message.projector_width);
    partial.projector_height = static_cast<int>(message.projector_height);
    partial.camera_frame = message.header.frame_id;
  }
  if (partial.frames.size() != message.num_frames) {
    return Fail("frame {}: states {} frames, an earlier one {}", message.index, message.num_frames,
                partial.frames.size());
  }
  auto frame = FromMessage(message);
  if (!frame) return tl::unexpected(frame.error());
  const auto pattern = FromMessage(message.pattern);
  if (!pattern) return tl::unexpected(pattern.error());
  if (!partial.frames[message.index]) ++partial.num_present;
  partial.frames[message.index] = std::move(*frame);
  partial.patterns[message.index] = *pattern;
  return {};
}

BagStack Assemble(PartialStack partial, const std::string& scan_id, int view_id) {
  BagStack result;
  result.camera_frame = std::move(partial.camera_frame);
  result.stack.scan_id = scan_id;
  result.stack.view_id = view_id;
  result.stack.sequence.width = partial.projector_width;
  result.stack.sequence.height = partial.projector_height;
  result.stack.sequence.frames = std::move(partial.patterns);
  for (auto& frame : partial.frames) result.stack.frames.push_back(std::move(*frame));
  return result;
}

}  // namespace

struct BagReader::Impl {
  explicit Impl(std::string bag_path) : path(std::move(bag_path)) {}

  std::string path;
  rosbag::Bag bag;
  std::map<std::string, std::string> types;  ///< of the topics
  std::unique_ptr<tf2::BufferCore> tf;       ///< filled when first asked for

  [[nodiscard]] std::string TopicList() const {
    std::string list;
    for (const auto& [name, type] : types) {
      list += (list.empty() ? "" : ", ") + name + " (" + type + ")";
    }
    return list.empty() ? "none" : list;
  }

  /// The topic itself, or the only one of its type whose name ends so.
  [[nodiscard]] Result<std::string> FindTopic(const std::string& topic, const std::string& type,
                                              const std::string& end) const {
    if (!topic.empty()) {
      const auto found = types.find(topic);
      if (found == types.end()) {
        return Fail("{}: has no topic {}; its topics are {}", path, topic, TopicList());
      }
      if (found->second != type) {
        return Fail("{}: topic {} is of type {}, must be {}", path, topic, found->second, type);
      }
      return topic;
    }
    std::vector<std::string> names;
    for (const auto& [name, topic_type] : types) {
      if (topic_type == type && EndsWith(name, end)) names.push_back(name);
    }
    if (names.empty()) {
      return Fail("{}: has no topic ...{} of type {}; its topics are {}", path, end, type,
                  TopicList());
    }
    if (names.size() > 1) {
      return Fail("{}: several topics could be meant, name one of {}", path, fmt::join(names, " "));
    }
    return names.front();
  }

  /// Calls use(message) for every message of a topic until it fails.
  template <typename Message, typename Use>
  [[nodiscard]] Status ForEach(const std::string& topic, const Use& use) {
    try {
      rosbag::View view(bag, rosbag::TopicQuery(topic));
      for (const rosbag::MessageInstance& instance : view) {
        const auto message = instance.instantiate<Message>();
        if (!message) {
          return Fail("{}: topic {} has a definition of {} that differs from this version's", path,
                      topic, instance.getDataType());
        }
        if (Status status = use(*message); !status) return status;
      }
    } catch (const std::exception& error) {
      // rosbag and the deserialiser throw on truncated chunks and lying lengths.
      return Fail("{}: topic {}: {}", path, topic, error.what());
    }
    return {};
  }

  template <typename Message>
  [[nodiscard]] Result<Message> First(const std::string& topic) {
    std::optional<Message> first;
    const Status status = ForEach<Message>(topic, [&first](const Message& message) -> Status {
      if (!first) first = message;
      return {};
    });
    if (!status) return tl::unexpected(status.error());
    if (!first) return Fail("{}: topic {} has no message", path, topic);
    return *first;
  }

  [[nodiscard]] Status LoadTf() {
    if (tf) return {};
    auto buffer = std::make_unique<tf2::BufferCore>(ros::Duration(kTfCacheSeconds));
    for (const auto& [topic, type] : types) {
      if (type != "tf2_msgs/TFMessage") continue;
      const bool is_static = EndsWith(topic, "tf_static");
      const Status status =
          ForEach<tf2_msgs::TFMessage>(topic, [&](const tf2_msgs::TFMessage& message) -> Status {
            for (const auto& transform : message.transforms) {
              buffer->setTransform(transform, "bag", is_static);
            }
            return {};
          });
      if (!status) return status;
    }
    tf = std::move(buffer);
    return {};
  }
};

BagReader::BagReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
BagReader::BagReader(BagReader&&) noexcept = default;
BagReader& BagReader::operator=(BagReader&&) noexcept = default;
BagReader::~BagReader() = default;

Result<BagReader> BagReader::Open(const std::string& path) {
  auto impl = std::make_unique<Impl>(path);
  try {
    impl->bag.open(path, rosbag::bagmode::Read);
    rosbag::View view(impl->bag);
    for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
      impl->types[connection->topic] = connection->datatype;
    }
  } catch (const std::exception& error) {
    return Fail("{}: cannot be read as a bag: {}", path, error.what());
  }
  return BagReader(std::move(impl));
}

std::vector<std::string> BagReader::Topics() const {
  std::vector<std::string> topics;
  for (const auto& [name, type] : impl_->types) topics.push_back(name + " (" + type + ")");
  return topics;
}

Result<CellCalibration> BagReader::ReadCalibration(const std::string& camera_info_topic,
                                                   const std::string& projector_info_topic) {
  const std::string type = "sensor_msgs/CameraInfo";
  const auto camera_topic = impl_->FindTopic(camera_info_topic, type, "camera_info");
  if (!camera_topic) return Forward(camera_topic);
  const auto projector_topic = impl_->FindTopic(projector_info_topic, type, "projector_info");
  if (!projector_topic) return Forward(projector_topic);
  const auto camera_info = impl_->First<sensor_msgs::CameraInfo>(*camera_topic);
  if (!camera_info) return Forward(camera_info);
  const auto projector_info = impl_->First<sensor_msgs::CameraInfo>(*projector_topic);
  if (!projector_info) return Forward(projector_info);

  const auto camera = FromMessage(*camera_info, impl_->path + ": " + *camera_topic);
  if (!camera) return Forward(camera);
  const auto projector = FromMessage(*projector_info, impl_->path + ": " + *projector_topic);
  if (!projector) return Forward(projector);
  const auto T_projector_camera =
      LookupTransform(projector_info->header.frame_id, camera_info->header.frame_id, 0);
  if (!T_projector_camera) return Forward(T_projector_camera);

  CellCalibration calibration;
  calibration.camera = *camera;
  calibration.projector = *projector;
  calibration.T_projector_camera = *T_projector_camera;
  if (Status status = Validate(calibration, impl_->path); !status) {
    return tl::unexpected(status.error());
  }
  return calibration;
}

Status BagReader::ReadStacks(const std::string& frames_topic, const std::string& scan_id,
                             const std::function<Status(BagStack)>& take,
                             const Progress& progress) {
  const auto topic = impl_->FindTopic(frames_topic, "fringe_fusion/Frame", "frames");
  if (!topic) return tl::unexpected(topic.error());
  rosbag::View count(impl_->bag, rosbag::TopicQuery(*topic));
  const double num_messages = std::max(1.0, static_cast<double>(count.size()));
  double num_read = 0.0;
  std::map<std::pair<std::string, std::uint32_t>, PartialStack> partial;
  std::set<std::string> scan_ids;
  std::string wanted = scan_id;
  const auto use = [&](const Frame& message) -> Status {
    if (!progress("import", num_read++ / num_messages)) return Fail("{}", kCancelled);
    scan_ids.insert(message.scan_id);
    if (scan_id.empty() && scan_ids.size() == 1) wanted = message.scan_id;
    if (message.scan_id != wanted) return {};
    const auto key = std::make_pair(message.scan_id, message.view_id);
    PartialStack& stack = partial[key];
    if (Status status = AddFrame(stack, message); !status) {
      return Fail("{}: {}: scan '{}' view {}: {}", impl_->path, *topic, message.scan_id,
                  message.view_id, status.error().message);
    }
    if (stack.num_present < stack.frames.size()) return {};
    BagStack complete =
        Assemble(std::move(stack), message.scan_id, static_cast<int>(message.view_id));
    partial.erase(key);
    return take(std::move(complete));
  };
  if (Status status = impl_->ForEach<Frame>(*topic, use); !status) return status;
  if (scan_id.empty() ? scan_ids.size() > 1 : scan_ids.count(scan_id) == 0) {
    return Fail("{}: {}: scan id '{}' must be one of '{}'", impl_->path, *topic, scan_id,
                fmt::join(scan_ids, "', '"));
  }
  if (!partial.empty()) {
    const auto& [key, stack] = *partial.begin();
    return Fail("{}: {}: scan '{}' view {} has {} of {} frames", impl_->path, *topic, key.first,
                key.second, stack.num_present, stack.frames.size());
  }
  return {};
}

bool BagReader::HasFrame(const std::string& frame) {
  // A reading error shows up again, in words, when a transform is looked up.
  if (!impl_->LoadTf()) return true;
  const std::vector<std::string> frames = [this] {
    std::vector<std::string> names;
    impl_->tf->_getFrameStrings(names);
    return names;
  }();
  return std::find(frames.begin(), frames.end(), frame) != frames.end();
}

Result<Transform> BagReader::LookupTransform(const std::string& target, const std::string& source,
                                             std::int64_t stamp_ns) {
  if (Status status = impl_->LoadTf(); !status) return tl::unexpected(status.error());
  try {
    const geometry_msgs::TransformStamped transform =
        impl_->tf->lookupTransform(target, source, ToRosTime(stamp_ns));
    return FromMessage(transform.transform);
  } catch (const tf2::TransformException& error) {
    return Fail("{}: tf {} <- {}: {}", impl_->path, target, source, error.what());
  }
}

Result<Mesh> BagReader::ReadCloud(const std::string& topic) {
  const auto found = impl_->FindTopic(topic, "sensor_msgs/PointCloud2", "");
  if (!found) return Forward(found);
  const auto message = impl_->First<sensor_msgs::PointCloud2>(*found);
  if (!message) return Forward(message);
  auto cloud = ToCloud(*message);
  if (!cloud) return Fail("{}: {}: {}", impl_->path, *found, cloud.error().message);
  return cloud;
}

}  // namespace fringe_fusion::ros_io
