// Main of every node; NODE_TYPE is defined for each.
#include "nodes/node_main.hpp"

int main(int argc, char** argv) { return fringe_fusion::nodes::RunNode(argc, argv, NODE_TYPE); }
