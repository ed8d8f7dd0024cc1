#pragma once

#include <string>

namespace fringe_fusion::nodes {

/// Body of every node's main: runs a node until shutdown.
/// @param type of the node, which is its default name too.
/// @return exit status: 0 after a shutdown, 1 with one line of words when the node cannot start.
[[nodiscard]] int RunNode(int argc, char** argv, const std::string& type);

}  // namespace fringe_fusion::nodes
