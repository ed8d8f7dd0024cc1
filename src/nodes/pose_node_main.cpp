#include "nodes/node_main.hpp"
#include "nodes/pose_node.hpp"

int main(int argc, char** argv) {
  return fringe_fusion::nodes::RunNode<fringe_fusion::nodes::PoseNode>(argc, argv, "pose_node");
}
