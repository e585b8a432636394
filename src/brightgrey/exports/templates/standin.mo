within ;
package Modelica "Stand-in for the few classes of the Modelica Standard Library that an export uses, to check it by"
  package Blocks
    package Interfaces
      connector RealInput = input Real;
      connector RealOutput = output Real;
    end Interfaces;
    package Types
      type Init = enumeration(NoInit, SteadyState, InitialState, InitialOutput);
    end Types;
    package Continuous
      model FirstOrder
        parameter Real k = 1;
        parameter Real T = 1;
        parameter Modelica.Blocks.Types.Init initType = Modelica.Blocks.Types.Init.NoInit;
        parameter Real y_start = 0;
        Modelica.Blocks.Interfaces.RealInput u;
        Modelica.Blocks.Interfaces.RealOutput y(start = y_start, fixed = true);
      equation
        der(y) = (k * u - y) / T;
      end FirstOrder;
    end Continuous;
    package Nonlinear
      model FixedDelay
        parameter Real delayTime = 1;
        Modelica.Blocks.Interfaces.RealInput u;
        Modelica.Blocks.Interfaces.RealOutput y;
      equation
        y = u; // the bench delays its input, more exactly than a buffer
      end FixedDelay;
    end Nonlinear;
  end Blocks;
  package Mechanics
@domains@
  end Mechanics;
end Modelica;
