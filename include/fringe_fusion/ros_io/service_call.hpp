#pragma once

#include <ros/node_handle.h>
#include <ros/service.h>

#include <chrono>
#include <future>
#include <memory>
#include <string>
#include <thread>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::ros_io {

/// Calls a service that answers with `bool success, string message`, and never waits longer than
/// timeout_s: roscpp's own call blocks for ever when the other node hangs.
/// @return the response; error naming the service when it is absent, silent, or says no.
template <typename Service>
[[nodiscard]] Result<typename Service::Response> CallService(
    const ros::NodeHandle& nh, const std::string& name, const typename Service::Request& request,
    double timeout_s) {
  struct Shared {
    std::string name;
    typename Service::Request request;
    typename Service::Response response;
    std::promise<bool> answered;
  };
  const auto shared = std::make_shared<Shared>();
  shared->name = nh.resolveName(name);
  shared->request = request;
  std::future<bool> answer = shared->answered.get_future();
  // Detached: a call that hangs is given up, and ends when the other node does.
  std::thread([shared] {
    shared->answered.set_value(ros::service::call(shared->name, shared->request, shared->response));
  }).detach();
  if (answer.wait_for(std::chrono::duration<double>(timeout_s)) != std::future_status::ready) {
    return Fail("service {} has not answered within {:.3g} s: its node hangs or is overloaded",
                shared->name, timeout_s);
  }
  if (!answer.get()) {
    return Fail("service {} is not there or died while answering: check that its node runs",
                shared->name);
  }
  if (shared->response.success == 0) return Fail("{}: {}", shared->name, shared->response.message);
  return std::move(shared->response);
}

}  // namespace fringe_fusion::ros_io
