// Energy and cost, as people read them. What is not known is not shown.

/** A number with so many decimals that three of its digits are seen, and two at least. */
const digits = value => value.toFixed(value > 0 ? Math.min(12, Math.max(2, 2 - Math.floor(Math.log10(value)))) : 2);

/** An energy in a unit that fits. */
export const energyText = kwh => (kwh < 0.1 ? `${digits(1000 * kwh)} Wh` : `${digits(kwh)} kWh`);

/** A price with so many decimals that something is seen of it. */
export const costText = (cost, currency) => `${digits(cost)} ${currency ?? ""}`.trim();

/** Energy and cost together; undefined: nothing is known. */
export function usedText({ kwh, cost }, currency) {
  if (kwh === undefined || kwh === null) return undefined;
  return cost === undefined || cost === null ? energyText(kwh) : `${energyText(kwh)}, ${costText(cost, currency)}`;
}

const SOURCES = { counters: "by the counters of its processors (RAPL)", watts: "by the given watts" };

/** The facts of a job's energy: name, text, help. */
export function energyFacts(energy) {
  if (!energy?.processor_seconds) return [];
  const used = usedText(energy, energy.currency);
  const help = "The share that its processes have of what their machines used, by processor time"
    + (energy.is_partial ? "; of some machines nothing is known" : "");
  return [
    ["Processor time", `${energy.processor_seconds.toFixed(1)} s`, "Seconds that processors worked for it, on all machines together"],
    used === undefined ? null : ["Energy", energy.is_partial ? `at least ${used}` : used, help],
  ].filter(Boolean);
}

/** By what the energy of a machine is known. */
export const sourceText = ({ source }) => SOURCES[source] ?? "";
