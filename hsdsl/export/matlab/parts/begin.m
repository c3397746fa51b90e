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
