function inside = @NAME_D(x, t, j, p)
% inside = @NAME_D(x, t, j, p)  Jump set: 1 where an edge of the mode of x = [mode; states] is made, else 0.
% It is made on or beyond its surface where the flow does not lead back and its condition holds.
@HEADING
@BEGIN
  inside = double(m.enabled(m, x, t, p) > 0);
end
