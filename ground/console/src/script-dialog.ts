/**
 * A script that is about to be sent: what it is for, to whom it goes, and a field for each of its parameters.
 */

import { argument, argumentText } from './argument';
import { html } from './dom';
import type { Argument, Parameter, Script } from './protocol';
import { spaced } from './words';

/** Shows the dialog; `send` is called with the parameters' values if the operator agrees. */
export function showScript(script: Script, toWhom: string, send: (values: Record<string, Argument>) => void): void {
  const cancel = html('button', { type: 'button', class: 'command' }, 'Cancel');
  const fields = script.parameters.map((parameter) => ({ parameter, input: input(parameter) }));
  const form = html(
    'form',
    { method: 'dialog' },
    html('h2', { id: 'script-title' }, `Send ${spaced(script.name)}?`),
    html('p', {}, script.about),
    html('p', {}, 'To ', html('strong', {}, toWhom)),
    ...fields.map(({ parameter, input }) => label(parameter, input)),
    html('div', { class: 'dialog-buttons' }, cancel, html('button', { class: 'command command-send' }, 'Send')),
  );
  const dialog = html('dialog', { class: 'script-dialog', 'aria-labelledby': 'script-title' }, form);
  cancel.addEventListener('click', () => dialog.close());
  dialog.addEventListener('close', () => dialog.remove());
  form.addEventListener('submit', () => {
    send(Object.fromEntries(fields.map(({ parameter, input }) => [parameter.name, argument(parameter.kind, input.value) ?? input.value])));
  });
  for (const { parameter, input } of fields) {
    const check = () => input.setCustomValidity(argument(parameter.kind, input.value) === null ? `Expected ${EXPECTED[parameter.kind]}` : '');
    input.addEventListener('input', check);
    check();
  }
  document.body.append(dialog);
  dialog.showModal();
}

const EXPECTED: Record<Parameter['kind'], string> = {
  number: 'a number',
  integer: 'a whole number',
  node: 'a node, such as uav/2',
  point: 'x, y, z in metres',
  route: 'a point x, y, z in metres on each line',
};

function input({ kind, default: preset, min, max }: Parameter): HTMLInputElement | HTMLTextAreaElement {
  const field =
    kind === 'route'
      ? html('textarea', { rows: '4', spellcheck: 'false' })
      : html('input', {
          type: kind === 'number' || kind === 'integer' ? 'number' : 'text',
          step: kind === 'integer' ? '1' : 'any',
          ...(min !== null && { min: String(min) }),
          ...(max !== null && { max: String(max) }),
        });
  field.required = true;
  field.placeholder = EXPECTED[kind];
  if (preset !== null) field.value = argumentText(preset);
  return field;
}

function label({ name, about, unit }: Parameter, field: HTMLElement): HTMLLabelElement {
  const words = html('span', {}, html('strong', {}, spaced(name)), ` ${about}`);
  return html('label', { class: 'parameter' }, words, field, html('span', { class: 'unit' }, unit));
}
