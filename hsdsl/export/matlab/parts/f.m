function dx = @NAME_f(x, t, j, p)
% dx = @NAME_f(x, t, j, p)  Flow map: the derivative of x = [mode; states].
@HEADING
@BEGIN
  q = x(1);
  n = m.dim(q);
  d = m.data(max(1, find(m.starts <= t, 1, 'last')), :);
  dx = zeros(size(x));
  if n > 0
    dx(2:n + 1) = m.flow{q}(t, reshape(x(2:n + 1), [], 1), p, d);
  end
end
