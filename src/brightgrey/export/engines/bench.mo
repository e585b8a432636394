
function sampled "Input between samples"
  input Real table[:];
  input Real place;
  output Real y;
protected
  Integer i;
algorithm
  i := integer(floor(place + 1e-9));
  i := if i < 0 then 0 elseif i > size(table, 1) - 2 then size(table, 1) - 2 else i;
  y := table[i + 1] + (table[i + 2] - table[i + 1]) * (@share@);
end sampled;

model Bench
  Drive drive(@starts@);
  parameter Real table[@samples@] = {@table@};
equation
  drive.u = sampled(table, time / @dt@);
end Bench;
