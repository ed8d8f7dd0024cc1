#pragma once

#include <ros/node_handle.h>

#include <chrono>
#include <future>
#include <mutex>
#include <string>
#include <thread>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::nodes {

/// Calls one ROS service with a time limit over a connection that is kept, which roscpp alone does
/// not offer: a server that is absent, dies or hangs ends as words instead of a hanging caller.
/// A call that was cut off is made again within its time limit, so the service must bear that.
template <typename Service>
class ServiceCaller {
 public:
  using Request = typename Service::Request;
  using Response = typename Service::Response;

  ServiceCaller(const ros::NodeHandle& nh, const std::string& service)
      : nh_(nh), service_(nh.resolveName(service)) {}

  [[nodiscard]] const std::string& service() const { return service_; }

  /// @param timeout_s of everything: finding the server, connecting and its answer.
  /// @return the answer, with `success` true; else an error naming the service and the cause.
  [[nodiscard]] Result<Response> Call(const Request& request, double timeout_s) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                             std::chrono::duration<double>(timeout_s));
    bool connected = false;
    while (ros::ok()) {
      if (!client_.isValid()) client_ = nh_.serviceClient<Service>(service_, /*persistent=*/true);
      if (client_.isValid()) {
        connected = true;
        Response response;
        if (CallUntil(deadline, request, response)) {
          if (!response.success) return Fail("{}: {}", service_, response.message);
          return response;
        }
      }
      if (Clock::now() >= deadline) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return Fail("service {} {} within {} s: is its node running?", service_,
                connected ? "did not answer" : "was not found", timeout_s);
  }

 private:
  using Clock = std::chrono::steady_clock;

  bool CallUntil(Clock::time_point deadline, Request request, Response& response) {
    std::future<bool> answer = std::async(std::launch::async, [this, &request, &response] {
      return client_.call(request, response);
    });
    // Dropping the connection is the only way to make a waiting call return.
    if (answer.wait_until(deadline) != std::future_status::ready) client_.shutdown();
    const bool answered = answer.get();
    if (!answered) client_.shutdown();
    return answered;
  }

  std::mutex mutex_;
  ros::NodeHandle nh_;
  std::string service_;
  ros::ServiceClient client_;
};

}  // namespace fringe_fusion::nodes
