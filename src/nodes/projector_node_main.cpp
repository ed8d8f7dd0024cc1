#include "nodes/node_main.hpp"
#include "nodes/projector_node.hpp"

int main(int argc, char** argv) {
  return fringe_fusion::nodes::RunNode<fringe_fusion::nodes::ProjectorNode>(argc, argv,
                                                                            "projector_node");
}
