#include "nodes/camera_node.hpp"
#include "nodes/node_main.hpp"

int main(int argc, char** argv) {
  return fringe_fusion::nodes::RunNode<fringe_fusion::nodes::CameraNode>(argc, argv, "camera_node");
}
