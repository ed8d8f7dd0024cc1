#include "nodes/motion_node.hpp"
#include "nodes/node_main.hpp"

int main(int argc, char** argv) {
  return fringe_fusion::nodes::RunNode<fringe_fusion::nodes::MotionNode>(argc, argv, "motion_node");
}
