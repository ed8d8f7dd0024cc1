// Every node as a nodelet; nodelet_plugins.xml lists the same names.
#include <pluginlib/class_list_macros.hpp>

#include "nodes/node_nodelet.hpp"
