#include "nodes/node_main.hpp"
#include "nodes/phase_node.hpp"

int main(int argc, char** argv) {
  return fringe_fusion::nodes::RunNode<fringe_fusion::nodes::PhaseNode>(argc, argv, "phase_node");
}
