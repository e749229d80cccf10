"""Steps MuJoCo models on behalf of a client at the other end of a binary pipe."""
