function inside = @NAME_D(x, t, j, p)
% inside = @NAME_D(x, t, j, p)  Jump set: 1 where an edge of the mode of x = [mode; states] is made, else 0.
% It is made on or beyond its surface where the flow does not lead back and its condition holds.
@HEADING
  persistent m
  if isempty(m)
    m = @NAME_model();
  end
  if nargin < 2
    t = 0;
  end
  if nargin < 4
    p = @NAME_parameters();
  end
  inside = double(m.enabled(m, x, t, p) > 0);
end
