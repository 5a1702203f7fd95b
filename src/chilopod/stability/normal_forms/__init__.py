"""Normal forms on centre manifolds, from evaluations of a return map."""
