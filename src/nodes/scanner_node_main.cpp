#include "nodes/node_main.hpp"
#include "nodes/scanner_node.hpp"

int main(int argc, char** argv) {
  return fringe_fusion::nodes::RunNode<fringe_fusion::nodes::ScannerNode>(argc, argv,
                                                                          "scanner_node");
}
