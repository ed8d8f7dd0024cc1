#include "nodes/cell_sim_node.hpp"
#include "nodes/node_main.hpp"

int main(int argc, char** argv) {
  return fringe_fusion::nodes::RunNode<fringe_fusion::nodes::CellSimNode>(argc, argv,
                                                                          "cell_sim_node");
}
