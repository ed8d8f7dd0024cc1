#include "fringe_fusion/ros_io/finding_messages.hpp"

namespace fringe_fusion::ros_io {

std::vector<CaptureFinding> ToMessages(const Diagnosis& diagnosis, int view_id) {
  std::vector<CaptureFinding> messages;
  for (const Finding& finding : diagnosis.findings) {
    CaptureFinding message;
    message.view_id = static_cast<std::uint32_t>(view_id);
    message.name = FindingName(finding.kind);
    message.value = finding.value;
    message.limit = finding.limit;
    message.unit = finding.unit;
    message.evidence = finding.evidence;
    message.advice = finding.advice;
    messages.push_back(message);
  }
  return messages;
}

}  // namespace fringe_fusion::ros_io
